"""Refusing a vehicle that cannot be, with errors that say which of its names or numbers is at fault."""

import re
from collections.abc import Iterable, Iterator, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from ..effects import (
    CHANNEL_UNITS,
    EQUATIONS,
    VELOCITIES,
    AbstractActuator,
    AbstractEffect,
    AbstractFlow,
    AbstractForce,
    AbstractInstrument,
    AbstractSensor,
    Derivative,
    Motion,
    options,
    parameter_table,
)
from ..effects.derivatives import alike
from ..errors import InputError, nearest
from .actuators import Actuator
from .attitude import EULER
from .base import AbstractVehicle, Layout
from .inertia import indefinite
from .products import ACTUATORS
from .schema import unknown_key
from .submerged_body import CURRENT, SubmergedBody

MOST_COORDINATES = 30
ENVIRONMENT = ("density", "ballast", "temperature", "altitude", *CURRENT)
GRAMMAR = (
    "a force X Y Z K M N, then _ and 0, a rate such as vdot, or a product of u v w p q r, U, n, T, delta_r, delta_e, "
    "delta_er, delta_el and delta_s, each also as |v|, over /U; or B_yaw_NAME of any input NAME"
)


def require_inertia(vehicle: AbstractVehicle, where: str) -> None:
    """Raise `InputError` where the inertia matrix of `vehicle` is not positive definite.

    It says `where` and names the coefficients.
    """
    names = [n for n in vehicle.own_values() if n.endswith("dot") or n.startswith(("I_", "mass"))]
    guilty = indefinite(jax.tree.map(np.asarray, vehicle).mass_matrix(), vehicle.layout.equations, names)
    if guilty:
        what = f"the inertia matrix is not positive definite because of {', '.join(guilty)}"
        raise InputError(f"{where}: coefficients", what, "check their signs: added masses such as Y_vdot are negative")


def check_names(layout: Layout, where: str) -> None:
    """Refuse equations, actuators, prescribed motions and surroundings that a body does not have."""
    motions = (*VELOCITIES.values(), "phi", "theta", "psi", "x", "y", "z")
    for section, names, known in (
        ("dof", layout.equations, EQUATIONS),
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


def check_inputs(layout: Layout, parts: Iterable[Actuator | AbstractEffect | Derivative | None], where: str) -> None:
    """Refuse inputs that have no symbol and that none of `parts` acts through, and those named as something else is."""
    used = {name for part in parts for name in inputs_of(part)}
    taken = {*CHANNEL_UNITS, *ENVIRONMENT, *EQUATIONS}
    for name, _ in layout.inputs:
        place = f"{where}: inputs.{name}"
        if name in taken or not name.isidentifier():
            what = "is the name of a motion or of surroundings" if name in taken else "is not a word"
            raise InputError(place, what, "give the input another name of letters, digits and _")
        if name not in (*ACTUATORS, *used):
            close = nearest(name, (*ACTUATORS, *used))
            known = f"known: {', '.join(ACTUATORS)}, and any that [actuators.{name}] or B_yaw_{name} acts through"
            raise InputError(place, "unknown key", f"did you mean {close}? {known}" if close else known)


def inputs_of(part: Actuator | AbstractEffect | Derivative | None) -> Iterator[str]:
    """The inputs that an actuator or a coefficient acts through, and the names that an effect takes."""
    if isinstance(part, Derivative):
        yield from part.inputs
    elif isinstance(part, Actuator):
        yield from dict(part.input)
    elif part is not None:
        for value in options(part).values():
            if isinstance(value, str):
                yield from (value, *value.split(","))
            elif isinstance(value, tuple):
                yield from value


def check_count(names: tuple[str, ...], where: str) -> None:
    """Refuse coordinates of a mechanism that are too many."""
    if len(names) > MOST_COORDINATES:
        # each of the inertia, damping and stiffness matrices is put together entry by entry
        what = f"names {len(names)} coordinates, whose matrices have {3 * len(names) ** 2} entries"
        raise InputError(f"{where}: dof", what, f"name {MOST_COORDINATES} at most")


def check_coordinates(layout: Layout, where: str) -> None:
    """Refuse coordinates of a mechanism whose names make one name mean two things."""
    names = layout.equations
    known: dict[str, str] = {}
    for name in names:
        if not re.fullmatch(r"\w+", name):
            raise InputError(f"{where}: dof.{name}", "is not a word", "use letters, digits and _")
        meanings = [(name, name), (f"{name}_rate", f"the rate of {name}")]
        meanings += [(f"I_{name}", f"the inertia of {name}")]
        meanings += [(f"I_{name}_{other}", f"the inertia between {name} and {other}") for other in names]
        meanings += [(f"B_{name}_{a}", f"what {a} does on {name}") for a, _ in layout.inputs]
        for symbol, meaning in meanings:
            if symbol in known:
                what = f"makes {symbol} both {known[symbol]} and {meaning}"
                raise InputError(f"{where}: dof", what, "give the coordinates other names")
            known[symbol] = meaning


def check_coefficients(terms: Mapping[str, Derivative | None], layout: Layout, where: str) -> None:
    """Refuse coefficients that are no derivative, say what another says, or act through an actuator there is not."""
    actuators = {actuator for actuator, _ in layout.inputs}
    for name, term in terms.items():
        place = f"{where}: coefficients.{name}"
        if term is None:
            close = nearest(name, _usual_coefficients())
            raise InputError(place, "unknown key", f"{f'did you mean {close}? ' if close else ''}known: {GRAMMAR}")
        ways = term.needs()
        if ways and not term.through(actuators):
            raise InputError(
                place, f"acts through {' and '.join(ways[0])}", "name that actuator's column under [inputs]"
            )
    if same := alike(terms):
        raise InputError(f"{where}: coefficients.{same[1]}", f"says what {same[0]} says", "delete one")


def check_turning(equations: tuple[str, ...], prescribed: Mapping[str, str], where: str) -> None:
    """Refuse a quaternion of a body that does not turn, or of which a recording gives an angle."""
    place = f"{where}: model.attitude"
    if not set(equations) & set(EQUATIONS[3:]):
        raise InputError(place, "is that of a body none of whose rotations is free", "delete it, or add one to dof")
    for angle in set(EULER) & set(prescribed):
        raise InputError(place, f"is a quaternion, and {angle} is prescribed", "delete one of them")


def check_effects(vehicle: AbstractVehicle, where: str) -> None:
    """Refuse effects on what the vehicle lacks, and one that is there twice."""
    layout = vehicle.layout
    labels = [effect.label for effect in vehicle.effects]
    motion = _at_rest(vehicle) if any(isinstance(effect, AbstractForce) for effect in vehicle.effects) else None
    for index, effect in enumerate(vehicle.effects):
        place = f"{where}: effects[{index + 1}] ({effect.name})"
        if labels.index(effect.label) < index:
            raise InputError(place, f"{effect.label} is there twice", "delete one")
        if motion is not None and isinstance(effect, AbstractForce):
            _check_force(effect, motion, vehicle, place)
        if isinstance(effect, AbstractFlow) and not isinstance(vehicle, SubmergedBody):
            raise InputError(place, f"moves water, which a {layout.kind} is not in", "delete it")
        if isinstance(effect, AbstractActuator) and effect.actuator not in dict(layout.inputs):
            hint = nearest(effect.actuator, [n for n, _ in layout.inputs]) or "an actuator of [inputs]"
            raise InputError(place, f"no actuator {effect.actuator}", f"use {hint}")
        if isinstance(effect, AbstractInstrument):
            _check_channels(effect, layout, place)


def _check_channels(effect: AbstractInstrument, layout: Layout, place: str) -> None:
    prescribed = [name for name, _ in layout.prescribed]
    may = [*layout.channels, *(prescribed if isinstance(effect, AbstractSensor) and effect.of_prescribed else ())]
    for channel in effect.channels:
        if channel in may:
            continue
        if channel in prescribed:
            remedy = "delete it, or measure that motion under [outputs]"
            raise InputError(place, f"cannot be on {channel}, which is prescribed", remedy)
        raise InputError(place, f"no channel {channel}", f"use {nearest(channel, may) or 'a channel of [outputs]'}")


def check_variation(vehicle: AbstractVehicle, where: str) -> None:
    """Refuse numbers that differ by run where the model has no run: in what commands and columns pass before it."""
    rows = {row.name: e for e in vehicle.effects for row in parameter_table(e).values()}
    own = numbers_that_may_vary(vehicle)
    for name in vehicle.spreads:
        if name not in own and not isinstance(rows.get(name), AbstractForce):
            known = "numbers of the body, coefficients, actuators, forces of effects, scales and offsets of outputs"
            raise InputError(f"{where}: {name}.varies", "cannot differ by run", f"delete it; these can: {known}")


def numbers_that_may_vary(vehicle: AbstractVehicle) -> frozenset[str]:
    """The numbers of a vehicle, without its effects', that may differ by run: all but those of inputs' columns."""
    inputs = tuple(name for name, _ in vehicle.layout.inputs)
    before = {name for name in vehicle.sensors.numbers if name.rpartition(".")[0] in inputs}
    return frozenset(vehicle.own_values()) - before


def _at_rest(vehicle: AbstractVehicle) -> Motion:
    """The motion at zero state and zero inputs."""
    layout = vehicle.layout
    state = jnp.zeros(len(layout.equations) + len(layout.positions))
    return vehicle.motion(state, jnp.zeros(len(layout.held) + len(layout.interpolated)))


def _check_force(effect: AbstractForce, motion: Motion, vehicle: AbstractVehicle, place: str) -> None:
    """Refuse a force that such a `motion` cannot make, or that no free equation of the vehicle feels."""
    layout = vehicle.layout
    try:
        felt = set(effect.force(motion)) & set(layout.equations)
    except KeyError as error:  # it looks for a motion, an actuator or a recorded column by its name
        devices = vehicle.actuators.items if isinstance(vehicle, SubmergedBody) else ()
        known = (*layout.equations, *dict(layout.inputs), *dict(layout.environment), *(one.name for one in devices))
        raise unknown_key(f"{place}: {error.args[0]}", known, str(error.args[0])) from error
    if not felt:
        raise InputError(
            place, f"acts on {', '.join(effect.where)}", f"free that in dof: {', '.join(layout.equations)}"
        )


def _usual_coefficients() -> tuple[str, ...]:
    """Symbols that a misspelt one may have meant."""
    letters, velocities = "XYZKMN", "uvwpqr"
    symbols = [f"{v}{more}" for v in velocities for more in ("", "dot", f"|{v}|")] + [f"u{v}" for v in velocities]
    symbols += ["0", "nn", "T", "delta_r", "delta_er", "delta_el", "delta_e", "delta_s", "uu_delta_r", "uu_delta_s"]
    return tuple(f"{letter}_{symbol}" for letter in letters for symbol in symbols)
