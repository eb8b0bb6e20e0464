"""Putting a vehicle together from named numbers."""

import dataclasses
import math

import jax.numpy as jnp

from ..effects import EQUATIONS, GRAVITY, STANDARD_DENSITY, AbstractEffect, derivative, parameter_table
from ..errors import InputError
from ..parameters import Parameter, number
from .actuators import Actuators, stage_numbers
from .attitude import EULER, QUATERNION
from .base import Layout, memory_states
from .checks import (
    check_coefficients,
    check_coordinates,
    check_effects,
    check_inputs,
    check_names,
    check_turning,
    check_variation,
    require_inertia,
)
from .damping import Damping
from .inertia import CENTRE_OF_GRAVITY, RIGID, Inertia
from .layout import Geometry, deviation
from .mechanism import Mechanism
from .own import Model, OwnModel, check_model, model_of
from .products import Products
from .restoring import Restoring
from .schema import unknown_key
from .sensors import Output, Sensors
from .submerged_body import SubmergedBody
from .ties import Tie, in_order, tied_rows, tied_values

BODY_KEYS = (
    "mass", "weight", "buoyancy", "inertia", "centre_of_buoyancy", "centre_of_gravity", "speed", "length", "diameter",
    "reference_density",
)  # fmt: skip
VECTORS = {
    "inertia": ("I_x", "I_y", "I_z"),
    "centre_of_buoyancy": ("x_B", "y_B", "z_B"),
    "centre_of_gravity": CENTRE_OF_GRAVITY,
}

Vehicle = SubmergedBody | Mechanism | OwnModel
Numbers = dict[str, tuple[float, Parameter]]
Pairs = tuple[tuple[str, str], ...]


@dataclasses.dataclass(frozen=True, kw_only=True)
class VehicleParts:
    """What a vehicle is put together from.

    **Fields**

    - `where`: what errors name. `name`: of the vehicle. `kind`: `submerged-body`, `mechanism` or `model`.
    - `dof`: its free equations.
    - `numbers`: value (SI) and row of every body entry and coefficient; zero where the physics has one that is absent.
    - `inputs`, `prescribed`, `environment`: actuators, locked motions and surroundings, each with its column.
    - `outputs`: the measured channels.
    - `model`: a user's equations, in place of a body's or a mechanism's.
    - `input_units`: SI units of inputs that have no symbol. `actuators`: those of a body; `numbers` has theirs too.
    - `sensor_numbers`: value and row of each scale, offset and mounting angle of a column.
    - `ties`: numbers that follow from others; `numbers` has them with any value.
    - `coriolis`: of a body, one of `CORIOLIS`; `attitude`: one of `ATTITUDES`.
    - `system`: in which the file gives its coefficients, as text.
    - `hull`: `length`, `diameter` (m; worked out from mass and inertia where absent), `reference_density` (kg/m³).
    - `geometry`: that the file states, from which coefficients can be estimated.
    - `effects`: those that the model has already, and `effect_rows` the rows of their free numbers.
    """

    where: str
    name: str
    kind: str
    dof: tuple[str, ...] | None
    numbers: Numbers
    inputs: Pairs
    outputs: tuple[Output, ...]
    prescribed: Pairs
    environment: Pairs
    hull: dict[str, float]
    geometry: Geometry | None
    model: type[Model] | Model | None
    coriolis: str
    attitude: str
    system: str
    ties: tuple[Tie, ...]
    input_units: dict[str, str]
    actuators: Actuators
    sensor_numbers: Numbers
    effects: tuple[AbstractEffect, ...]
    effect_rows: tuple[Parameter, ...]


def build(parts: VehicleParts) -> Vehicle:
    """The vehicle of those `parts`.

    **Raises** `InputError` with `where` and the key for names it does not know, and for an inertia matrix that is
    not positive definite, with the coefficients that make it so.
    """
    where, numbers, of_sensors = parts.where, parts.numbers, parts.sensor_numbers
    parts = dataclasses.replace(parts, ties=in_order(parts.ties, where))
    _require_unlike(numbers, of_sensors, where)
    rows = tuple(row for _, row in (numbers | of_sensors).values())
    values = {key: number(value) for key, (value, _) in numbers.items()}
    given = {key: value for key, (value, _) in (numbers | of_sensors).items()}
    given |= _before(parts.actuators, parts.effects)
    tied = tied_values(parts.ties, given, where)
    values |= {key: number(value) for key, value in tied.items() if key in numbers}
    hull = parts.hull
    if parts.kind == "submerged-body":
        values = _complete(values, where)
        hull = _sizes(values, hull)
    rows = _under_ties(parts, (*rows, *parts.effect_rows), given | tied)
    spreads = {row.name: number(row.spread or math.nan) for row in rows if row.varies}
    # a number of the vehicle and not of its layout, for which programs are compiled
    layout = _layout(parts, tuple(dataclasses.replace(row, spread=0.0) for row in rows), hull)
    density = hull.get("reference_density", STANDARD_DENSITY)
    vehicle = _of_kind(parts, values, layout, density)
    sensors = Sensors({key: number(value) for key, (value, _) in of_sensors.items()}, density)
    vehicle = dataclasses.replace(vehicle, sensors=sensors, spreads=spreads)
    if parts.ties:
        vehicle = vehicle.with_values({})  # the numbers of effects and sensors that follow others
    check_effects(vehicle, where)
    check_variation(vehicle, where)
    require_inertia(vehicle, where)
    return vehicle


def _under_ties(parts: VehicleParts, rows: tuple[Parameter, ...], values: dict[str, float]) -> tuple[Parameter, ...]:
    """The `rows` under what bounds and priors of ties say; stages have their own names there and those of `values`."""
    names = stage_numbers(parts.actuators.items, parts.effects)
    back = {own: alias for alias, own in names.items()}
    named = tuple(dataclasses.replace(row, name=back.get(row.name, row.name)) for row in rows)
    limited = tied_rows(parts.ties, named, values, parts.where)
    return tuple(dataclasses.replace(row, name=names.get(row.name, row.name)) for row in limited)


def _layout(parts: VehicleParts, rows: tuple[Parameter, ...], hull: dict[str, float]) -> Layout:
    """Names, columns and the `rows` of all numbers."""
    equations = parts.model.states if parts.model is not None else parts.dof or EQUATIONS
    prescribed, turned = dict(parts.prescribed), ()
    if parts.attitude == "quaternion":
        check_turning(equations, prescribed, parts.where)
        turned = QUATERNION
    positions = equations if parts.kind == "mechanism" else ()
    if parts.kind == "submerged-body":
        positions = _positions(equations, prescribed, tuple(output.state for output in parts.outputs), turned)
    positions += (*memory_states(parts.effects), *(deviation(row.name) for row in rows if row.varies))
    sizes = {key: hull.get(key, 0.0) for key in ("length", "diameter")}
    return Layout(
        parts.name, parts.kind, equations, positions, parts.inputs, parts.prescribed, parts.environment, parts.outputs,
        rows, **sizes, system=parts.system, ties=tuple(tie.alone for tie in parts.ties),
        input_units=tuple(parts.input_units.items()), geometry=parts.geometry,
    )  # fmt: skip


def _of_kind(parts: VehicleParts, values: dict, layout: Layout, density: float) -> Vehicle:
    """The vehicle of its kind with the numbers `values`, in water of a reference `density` (kg/m³)."""
    if parts.model is not None:
        return _own(parts.model, values, layout, parts.effects, parts.where)
    if parts.kind == "mechanism":
        return _mechanism(values, layout, parts.effects, parts.where)
    devices = parts.actuators.in_water(density).with_values(values)
    body = _body(values, layout, parts.effects, devices, density, parts.where)
    return dataclasses.replace(body, coriolis=parts.coriolis)


def _require_unlike(numbers: Numbers, of_sensors: Numbers, where: str) -> None:
    """Refuse a number of a column that an actuator of the same name has too."""
    for name in of_sensors:
        if name in numbers:
            raise InputError(f"{where}: {name}", "is a number of an actuator and of a column", "rename the actuator")


def _before(devices: Actuators, effects: tuple[AbstractEffect, ...]) -> dict[str, float]:
    """The numbers of what stands before the actuators, by the names that expressions have for them."""
    values = {row.name: getattr(e, field) for e in effects for field, row in parameter_table(e).items()}
    return {alias: float(values[name]) for alias, name in stage_numbers(devices.items, effects).items()}


def _complete(values: dict, where: str) -> dict:
    """Body numbers with those that follow from others filled in."""
    for key in ("mass", "I_x", "I_y", "I_z", "weight", "buoyancy"):
        if key in values and float(values[key]) <= 0.0:
            raise InputError(f"{where}: body.{key}", f"is {float(values[key]):g}", "give a positive number")
    if "mass" not in values:
        raise InputError(f"{where}: body.mass", "is missing", "add mass = … in kg")
    weight = values.get("weight", values["mass"] * GRAVITY)
    filled = {"weight": weight, "buoyancy": weight, "speed": jnp.zeros(())}
    filled |= dict.fromkeys(("x_B", "y_B", "z_B"), jnp.zeros(()))
    # a locked rotation needs no inertia; any positive number keeps the 6 × 6 matrix regular
    filled |= dict.fromkeys(("I_x", "I_y", "I_z"), values["mass"])
    return filled | values


def _sizes(values: dict, hull: dict[str, float]) -> dict[str, float]:
    """Length and diameter: as given, else of the uniform rod that has this mass and pitch inertia."""
    mass = float(values["mass"])
    rounded = lambda size: float(f"{size:.4g}")
    length = hull.get("length", rounded(math.sqrt(12.0 * float(values["I_y"]) / mass)))
    density = hull.get("reference_density", STANDARD_DENSITY)
    diameter = hull.get("diameter", rounded(math.sqrt(4.0 * mass / density / (math.pi * length))))
    return hull | {"length": length, "diameter": diameter}


def _positions(
    equations: tuple[str, ...], prescribed: dict[str, str], shown: tuple[str, ...], turned: tuple[str, ...]
) -> tuple[str, ...]:
    """The position states a body needs: attitudes that can change, depth, and x and y where they are measured.

    The attitude is `turned`, or Euler angles where that is empty.
    """
    angles = dict(zip(EULER, EQUATIONS[3:], strict=True))
    free = [angle for angle, equation in angles.items() if equation in equations and angle not in prescribed]
    states = list(turned or free)
    states += [axis for axis in ("x", "y") if {"x", "y"} & set(shown)]
    return (*states, "z") if "z" not in prescribed else tuple(states)


def _body(
    values: dict, layout: Layout, effects: tuple, devices: Actuators, density: float, where: str
) -> SubmergedBody:
    check_names(layout, where)
    body = {
        *devices.values(),
        "mass",
        "weight",
        "buoyancy",
        "speed",
        *RIGID,
        *VECTORS["centre_of_buoyancy"],
        *CENTRE_OF_GRAVITY,
    }
    terms = {name: derivative(name) for name in values if name not in body}
    check_inputs(layout, (*devices.items, *effects, *terms.values()), where)
    check_coefficients(terms, layout, where)
    taken = lambda sort: {name: values[name] for name, term in terms.items() if term is not None and sort(term)}
    added, damping = taken(lambda term: term.rate), taken(lambda term: term.linear)
    products = taken(lambda term: not (term.rate or term.linear))
    heavy = tuple(name for name in CENTRE_OF_GRAVITY if name in values)
    rigid = {name: values[name] for name in ("mass", "I_x", "I_y", "I_z", *heavy)}
    restoring = {name: values[name] for name in ("weight", "buoyancy", *VECTORS["centre_of_buoyancy"], *heavy)}
    return SubmergedBody(
        inertia=Inertia(rigid, added),
        damping=Damping(damping),
        products=Products(products),
        restoring=Restoring(restoring, density),
        cruise=values["speed"],
        layout=layout,
        effects=effects,
        actuators=devices,
    )


def _own(model: type[Model] | Model, values: dict, layout: Layout, effects: tuple, where: str) -> OwnModel:
    made = model_of(model, values, where)
    check_model(made, layout, where)
    return OwnModel(model=made, layout=layout, effects=effects)


def _mechanism(values: dict, layout: Layout, effects: tuple, where: str) -> Mechanism:
    check_coordinates(layout, where)
    e, inputs = layout.equations, [name for name, _ in layout.inputs]
    known = [f"{letter}_{q}" for letter in "IDKF" for q in e] + [f"B_{q}_{a}" for q in e for a in inputs]
    known += [f"{letter}_{q}_{s}" for letter in "IDK" for q in e for s in e if q != s]
    for name in values:
        if name not in known:
            raise unknown_key(f"{where}: coefficients.{name}", tuple(known), name)
    return Mechanism(coefficients=values, layout=layout, effects=effects)
