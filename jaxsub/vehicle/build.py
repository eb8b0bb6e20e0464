"""Putting a vehicle together from named numbers, and refusing one that cannot be."""

import math
import re

import jax.numpy as jnp
import numpy as np

from ..effects import (
    CHANNEL_UNITS,
    EQUATIONS,
    VELOCITIES,
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractSensor,
)
from ..errors import InputError, nearest
from ..parameters import Parameter, number
from .base import Layout, Output
from .control import ACTUATORS, Control, needs
from .damping import Damping
from .inertia import RIGID, Inertia, indefinite
from .mechanism import Mechanism
from .restoring import STANDARD_DENSITY, Restoring
from .schema import unknown_key
from .submerged_body import SubmergedBody

BODY_KEYS = (
    "mass", "weight", "buoyancy", "inertia", "centre_of_buoyancy", "speed", "length", "diameter", "reference_density"
)  # fmt: skip
VECTORS = {"inertia": ("I_x", "I_y", "I_z"), "centre_of_buoyancy": ("x_B", "y_B", "z_B")}
ENVIRONMENT = ("density", "ballast", "temperature")

_ADDED = re.compile(r"^[XYZKMN]_[uvwpqr]dot$")
_DAMPING = re.compile(r"^[XYZKMN]_[uvwpqr]$")
_CONTROL = re.compile(r"^[XYZKMN]_(0|nn|delta_(r|er|el|e|s))$")

Numbers = dict[str, tuple[float, Parameter]]
Pairs = tuple[tuple[str, str], ...]


def build(
    *,
    where: str,
    name: str,
    kind: str,
    dof: tuple[str, ...] | None,
    numbers: Numbers,
    inputs: Pairs,
    outputs: tuple[Output, ...],
    prescribed: Pairs = (),
    environment: Pairs = (),
    hull: dict[str, float] | None = None,
    effects: tuple[AbstractEffect, ...] = (),
    effect_rows: tuple[Parameter, ...] = (),
) -> SubmergedBody | Mechanism:
    """The vehicle of those parts.

    **Arguments**

    - `numbers`: value and row of every body entry and coefficient; zero where the physics has one that is absent.
    - `hull`: `length`, `diameter` (m; worked out from mass and inertia where absent), `reference_density` (kg/m³).

    **Raises** `InputError` with `where` and the key for names it does not know, and for an inertia matrix that is
    not positive definite, with the coefficients that make it so.
    """
    hull = dict(hull or {})
    rows = tuple(row for _, row in numbers.values()) + effect_rows
    values = {key: number(value) for key, (value, _) in numbers.items()}
    if kind == "submerged-body":
        values = _complete(values, where)
        hull = _sizes(values, hull)
    equations = dof or EQUATIONS
    shown = tuple(output.channel for output in outputs)
    positions = _positions(equations, dict(prescribed), shown) if kind == "submerged-body" else equations
    sizes = {key: hull.get(key, 0.0) for key in ("length", "diameter")}
    layout = Layout(name, kind, equations, positions, inputs, prescribed, environment, outputs, rows, **sizes)
    if kind == "mechanism":
        vehicle = _mechanism(values, layout, effects, where)
    else:
        vehicle = _body(values, layout, effects, hull.get("reference_density", STANDARD_DENSITY), where)
    _check_outputs(vehicle, where)
    _check_effects(vehicle, where)
    require_inertia(vehicle, where)
    return vehicle


def require_inertia(vehicle: SubmergedBody | Mechanism, where: str) -> None:
    """Raise `InputError` naming the coefficients where the inertia matrix is not positive definite."""
    names = [n for n in vehicle.own_values() if n.endswith("dot") or n.startswith(("I_", "mass"))]
    guilty = indefinite(np.asarray(vehicle.mass_matrix()), vehicle.layout.equations, names)
    if guilty:
        what = f"the inertia matrix is not positive definite because of {', '.join(guilty)}"
        raise InputError(f"{where}: coefficients", what, "check their signs: added masses such as Y_vdot are negative")


def _complete(values: dict, where: str) -> dict:
    """Body numbers with those that follow from others filled in."""
    for key in ("mass", "I_x", "I_y", "I_z", "weight", "buoyancy"):
        if key in values and float(values[key]) <= 0.0:
            raise InputError(f"{where}: body.{key}", f"is {float(values[key]):g}", "give a positive number")
    if "mass" not in values:
        raise InputError(f"{where}: body.mass", "is missing", "add mass = … in kg")
    weight = values.get("weight", values["mass"] * 9.80665)
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
    diameter = hull.get("diameter", rounded(math.sqrt(4.0 * mass / STANDARD_DENSITY / (math.pi * length))))
    return hull | {"length": length, "diameter": diameter}


def _positions(equations: tuple[str, ...], prescribed: dict[str, str], shown: tuple[str, ...]) -> tuple[str, ...]:
    """The position states a body needs: attitudes that can change, depth, and x and y where they are measured."""
    turned = {"phi": "roll", "theta": "pitch", "psi": "yaw"}
    states = [angle for angle, equation in turned.items() if equation in equations and angle not in prescribed]
    states += [axis for axis in ("x", "y") if {"x", "y"} & set(shown)]
    return (*states, "z") if "z" not in prescribed else tuple(states)


def _body(values: dict, layout: Layout, effects: tuple, density: float, where: str) -> SubmergedBody:
    _check_names(layout, where)
    body = {"mass", "weight", "buoyancy", "speed", *RIGID, "x_B", "y_B", "z_B"}
    taken = lambda pattern: {n: v for n, v in values.items() if n not in body and pattern.match(n)}
    added, damping, control = taken(_ADDED), taken(_DAMPING), taken(_CONTROL)
    known = body | set(added) | set(damping) | set(control)
    actuators = {actuator for actuator, _ in layout.inputs}
    for name in values:
        place = f"{where}: coefficients.{name}"
        if name not in known:
            raise unknown_key(place, _all_coefficients(), name)
        ways = needs(name) if name in control else ()
        if ways and not any(set(way) <= actuators for way in ways):
            raise InputError(
                place, f"acts through {' and '.join(ways[0])}", "name that actuator's column under [inputs]"
            )
    rigid = {name: values[name] for name in ("mass", "I_x", "I_y", "I_z")}
    restoring = {name: values[name] for name in ("weight", "buoyancy", "x_B", "y_B", "z_B")}
    return SubmergedBody(
        inertia=Inertia(rigid, added),
        damping=Damping(damping),
        control=Control(control),
        restoring=Restoring(restoring, density),
        cruise=values["speed"],
        layout=layout,
        effects=effects,
    )


def _mechanism(values: dict, layout: Layout, effects: tuple, where: str) -> Mechanism:
    e, inputs = layout.equations, [name for name, _ in layout.inputs]
    known = [f"{letter}_{q}" for letter in "IDKF" for q in e] + [f"B_{q}_{a}" for q in e for a in inputs]
    known += [f"{letter}_{q}_{s}" for letter in "IDK" for q in e for s in e if q != s]
    for name in values:
        if name not in known:
            raise unknown_key(f"{where}: coefficients.{name}", tuple(known), name)
    return Mechanism(coefficients=values, layout=layout, effects=effects)


def _check_names(layout: Layout, where: str) -> None:
    """Refuse equations, actuators, prescribed motions and surroundings that a body does not have."""
    motions = (*VELOCITIES.values(), "phi", "theta", "psi", "x", "y", "z")
    for section, names, known in (
        ("dof", layout.equations, EQUATIONS),
        ("inputs", [n for n, _ in layout.inputs], ACTUATORS),
        ("prescribed", [n for n, _ in layout.prescribed], motions),
        ("environment", [n for n, _ in layout.environment], ENVIRONMENT),
    ):
        for name in names:
            if name not in known:
                raise unknown_key(f"{where}: {section}.{name}", tuple(known), name)
    for name, _ in layout.prescribed:
        equation = dict(zip(VELOCITIES.values(), EQUATIONS, strict=True)).get(name)
        if equation in layout.equations:
            raise InputError(
                f"{where}: prescribed.{name}", f"{equation} is free", "leave it out of dof or of prescribed"
            )


def _check_outputs(vehicle: SubmergedBody | Mechanism, where: str) -> None:
    """Refuse channels that the vehicle does not produce."""
    layout = vehicle.layout
    own = (f for e in layout.equations for f in (e, f"{e}_rate"))
    known = tuple(CHANNEL_UNITS) if isinstance(vehicle, SubmergedBody) else tuple(own)
    for channel in layout.channels:
        if channel not in known:
            raise unknown_key(f"{where}: outputs.{channel}", known, channel)


def _check_effects(vehicle: SubmergedBody | Mechanism, where: str) -> None:
    """Refuse effects on what the vehicle lacks, and one that is there twice."""
    layout = vehicle.layout
    labels = [effect.label for effect in vehicle.effects]
    for index, effect in enumerate(vehicle.effects):
        place = f"{where}: effects[{index + 1}] ({effect.name})"
        if labels.index(effect.label) < index:
            raise InputError(place, f"{effect.label} is there twice", "delete one")
        if isinstance(effect, AbstractForce):
            _check_force(effect, vehicle, place)
        if isinstance(effect, AbstractActuator) and effect.actuator not in dict(layout.inputs):
            hint = nearest(effect.actuator, [n for n, _ in layout.inputs]) or "an actuator of [inputs]"
            raise InputError(place, f"no actuator {effect.actuator}", f"use {hint}")
        if isinstance(effect, AbstractSensor) and effect.channel not in layout.channels:
            hint = nearest(effect.channel, list(layout.channels)) or "a channel of [outputs]"
            raise InputError(place, f"no channel {effect.channel}", f"use {hint}")


def _check_force(effect: AbstractForce, vehicle: SubmergedBody | Mechanism, place: str) -> None:
    """Refuse a force that the vehicle's motion cannot make, or that no free equation feels."""
    layout = vehicle.layout
    state = jnp.zeros(len(layout.equations) + len(layout.positions))
    motion = vehicle.motion(state, jnp.zeros(len(layout.held) + len(layout.interpolated)))
    try:
        felt = set(effect.force(motion)) & set(layout.equations)
    except KeyError as error:  # it looks for a motion, an actuator or a recorded column by its name
        known = (*layout.equations, *dict(layout.inputs), *dict(layout.environment))
        raise unknown_key(f"{place}: {error.args[0]}", known, str(error.args[0])) from error
    if not felt:
        raise InputError(
            place, f"acts on {', '.join(effect.where)}", f"free that in dof: {', '.join(layout.equations)}"
        )


def _all_coefficients() -> tuple[str, ...]:
    letters, velocities = "XYZKMN", "uvwpqr"
    fins = ("0", "delta_r", "delta_er", "delta_el", "delta_e", "delta_s")
    names = [f"{f}_{v}{dot}" for f in letters for v in velocities for dot in ("", "dot")]
    return (*names, *(f"{f}_{fin}" for f in letters for fin in fins), "X_nn")
