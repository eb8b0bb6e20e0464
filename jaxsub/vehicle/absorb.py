"""Effects that are one number of the vehicle, a hydrodynamic derivative or an actuator's gain, as that, and back."""

import dataclasses
from collections.abc import Sequence

from ..effects import AbstractDerivative, AbstractEffect, ActuatorGain, Facts, derivative, parameter_table, with_numbers
from ..effects.registry import named
from ..parameters import Parameter, number
from .actuators import Actuators, Rudder
from .base import AbstractVehicle
from .products import Products, derivatives
from .submerged_body import SubmergedBody


def with_coefficients(vehicle: AbstractVehicle) -> AbstractVehicle:
    """The same vehicle with each effect that is one derivative as that coefficient, and a gain as its actuator's.

    So `quadratic-damping[roll]` becomes `K_p|p|`, and `actuator-gain[bow]` the `gain` of `[actuators.bow]`.
    A mechanism, whose coefficients have no such symbols, stays as it is. So does an effect whose coefficient is there
    already, or whose actuator has no symbol, or no number that scales its force alone.
    """
    if not isinstance(vehicle, SubmergedBody):
        return vehicle
    for effect in vehicle.effects:
        if isinstance(effect, ActuatorGain):
            vehicle = _with_gain(vehicle, effect)
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
    there, values, layout = {effect.label for effect in vehicle.all_effects}, improved.values(), improved.layout
    facts = Facts(
        layout.kind, layout.equations, tuple(name for name, _ in layout.inputs), layout.channels, (), 0.0, 0.0, {}, 0.0
    )
    found = [effect for effect in improved.all_effects if effect.label not in there]
    for name, term in derivatives(improved.own_values()).items():
        if term.name in vehicle.has or term.rate or (effect := named(term, facts, tuple(kinds))) is None:
            continue
        (field,) = parameter_table(effect)
        found.append(with_numbers(effect, {field: term.sign * values[name]}))
    return found + _gains(improved, vehicle) if ActuatorGain in kinds else found


def _renamed(row: Parameter, name: str, unit: str, sign: int) -> Parameter:
    lower, upper = sorted((sign * row.lower, sign * row.upper))
    return dataclasses.replace(row, name=name, unit=unit, lower=lower, upper=upper, prior_mean=sign * row.prior_mean)


def _with_gain(vehicle: SubmergedBody, effect: ActuatorGain) -> SubmergedBody:
    """The same body with the effect as the number of its actuator that scales this actuator's force and no other."""
    items, tied = vehicle.actuators.items, {tie.name for tie in vehicle.layout.ties}
    item = next((item for item in items if item.name == effect.actuator), None)
    # what a propeller loses, a rudder in its race loses too
    raced = any(isinstance(one, Rudder) and one.propeller == effect.actuator for one in items)
    if item is None or not item.factor or raced or f"{item.name}.{item.factor}" in {*tied, *vehicle.spreads}:
        return vehicle
    ((field, old),) = parameter_table(effect).items()
    row = next(row for row in vehicle.layout.parameters if row.name == old.name)
    vehicle = vehicle.without_effect(effect.label)
    before, unit = float(item.value(item.factor, 1.0)), vehicle.layout.input_unit(item.input[0][0])
    numbers = item.numbers | {item.factor: number(before * (1.0 + getattr(effect, field)))}
    items = tuple(dataclasses.replace(one, numbers=numbers) if one is item else one for one in items)
    name, unit = f"{item.name}.{item.factor}", item.unit_of(item.factor, unit)
    own = Parameter(name, unit, row.free, prior_std=abs(before) * row.prior_std, prior_mean=before)
    rows = tuple(one for one in vehicle.layout.parameters if one.name != name)
    layout = dataclasses.replace(vehicle.layout, parameters=(*rows, own))
    return dataclasses.replace(vehicle, actuators=Actuators(items), layout=layout)


def _gains(improved: AbstractVehicle, vehicle: AbstractVehicle) -> list[AbstractEffect]:
    """The numbers of actuators in `improved` that are not those that `vehicle` holds, as effects."""
    if not (isinstance(improved, SubmergedBody) and isinstance(vehicle, SubmergedBody)):
        return []
    now, found = {item.name: item for item in improved.actuators.items}, []
    for item in vehicle.actuators.items:
        if item.name not in vehicle.fixed_gains or not item.factor or item.name not in now:
            continue
        before, after = (one.value(item.factor, 1.0) for one in (item, now[item.name]))
        if float(after) != float(before):
            found.append(ActuatorGain(item.name, number(after / before - 1.0)))
    return found
