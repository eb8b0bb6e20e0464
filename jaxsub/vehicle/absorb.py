"""Effects that are one hydrodynamic derivative, as coefficients of the vehicle, and back."""

import dataclasses
from collections.abc import Sequence

from ..effects import AbstractDerivative, AbstractEffect, Facts, derivative, named, parameter_table, with_numbers
from ..parameters import Parameter, number
from .base import AbstractVehicle
from .products import Products, derivatives
from .submerged_body import SubmergedBody


def with_coefficients(vehicle: AbstractVehicle) -> AbstractVehicle:
    """The same vehicle with each effect that is one derivative as that coefficient.

    So `quadratic-damping[roll]` becomes `K_p|p|`. A mechanism, whose coefficients have no such symbols, stays as it is.
    So does an effect whose coefficient is there already or whose actuator has no symbol.
    """
    if not isinstance(vehicle, SubmergedBody):
        return vehicle
    for effect in vehicle.effects:
        if not isinstance(effect, AbstractDerivative):
            continue
        term = effect.derivative
        if term.name in vehicle.has or derivative(term.name) != term:
            continue
        ((field, old),) = parameter_table(effect).items()
        row = next(row for row in vehicle.layout.parameters if row.name == old.name)
        vehicle = vehicle.without_effect(effect.label)
        value = number(term.sign * getattr(effect, field))
        products = Products(vehicle.products.coefficients | {term.name: value})
        layout = dataclasses.replace(
            vehicle.layout, parameters=(*vehicle.layout.parameters, _renamed(row, term.name, term.unit, term.sign))
        )
        vehicle = dataclasses.replace(vehicle, products=products, layout=layout)
    return vehicle


def added_effects(
    improved: AbstractVehicle, vehicle: AbstractVehicle, kinds: Sequence[type[AbstractEffect]]
) -> list[AbstractEffect]:
    """What `improved` has more than `vehicle`, as effects of `kinds`: its own, and those whose coefficients it has."""
    there, values, layout = {effect.label for effect in vehicle.effects}, improved.values(), improved.layout
    facts = Facts(
        layout.kind, layout.equations, tuple(name for name, _ in layout.inputs), layout.channels, (), 0.0, 0.0, {}, 0.0
    )
    found = [effect for effect in improved.effects if effect.label not in there]
    for name, term in derivatives(improved.own_values()).items():
        if term.name in vehicle.has or term.rate or (effect := named(term, facts, tuple(kinds))) is None:
            continue
        (field,) = parameter_table(effect)
        found.append(with_numbers(effect, {field: term.sign * values[name]}))
    return found


def _renamed(row: Parameter, name: str, unit: str, sign: int) -> Parameter:
    lower, upper = sorted((sign * row.lower, sign * row.upper))
    return dataclasses.replace(row, name=name, unit=unit, lower=lower, upper=upper, prior_mean=sign * row.prior_mean)
