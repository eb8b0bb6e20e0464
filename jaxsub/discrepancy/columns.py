"""What each candidate effect adds to the next sample, per unit of its amplitude, along the motion that took place."""

import dataclasses
import itertools
from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from ..arrays import Values, quietly
from ..effects import (
    EQUATIONS,
    AbstractActuator,
    AbstractEffect,
    AbstractFlow,
    AbstractForce,
    AbstractInstrument,
    AbstractMemory,
    Motion,
    amplitudes,
    numbers,
    stacked,
    with_memories,
    with_numbers,
)
from ..likelihood import Columns
from ..programs import compiled
from ..simulation import Trajectory
from ..vehicle import AbstractVehicle
from .view import View

# amplitude of an effect by which its slope is taken, SI: effects are linear in theirs, some only about zero
_SMALL = 1e-3
# by how much a shape such as a lag is moved to see which way the data would have it
_NUDGE = 0.1
# forces of which columns are made at once
_AT_ONCE = 64


def candidate_columns(view: View, candidates: Sequence[AbstractEffect]) -> tuple[Columns, list[list[int]]]:
    """The columns of all candidates, and which of them each candidate has.

    An effect with amplitudes has a column for each, its slope at zero. One with none, such as a lag, enters as the
    whole difference that it makes at its grid value, and the difference that a little more of it would make.
    """
    made = _effect_columns(view, candidates)
    shows = [isinstance(effect, AbstractInstrument) for effect in candidates]
    of_sort = lambda shown: [c for own, kind in zip(made, shows, strict=True) if kind is shown for c in own]
    forces, outputs = of_sort(False), of_sort(True)
    # forces come first
    free = {False: itertools.count(), True: itertools.count(len(forces))}
    owners = [[next(free[kind]) for _ in own] for own, kind in zip(made, shows, strict=True)]
    return columns_of(view, forces, outputs), owners


def columns_of(view: View, forces: Sequence[np.ndarray], outputs: Sequence[np.ndarray] = ()) -> Columns:
    """Columns of forces at both ends of each interval, (2, R, K-1, n), then of changes of the channels, (R, K, c), SI.

    They are written where they stay, some at a time: copies of hundreds would take several times their memory.
    """
    system, count = view.followed.system, len(forces) + len(outputs)
    shown, forcing = np.zeros((*system.C.shape[:3], count)), np.zeros((*system.A.shape[:3], count))
    G, measured = np.asarray(system.G), np.asarray(system.measured)
    for first in range(0, len(forces), _AT_ONCE):
        begin, end = np.stack(forces[first : first + _AT_ONCE], axis=-1)
        forcing[..., first : first + begin.shape[-1]] = G @ np.concatenate([begin, end], axis=2)
    for i, change in enumerate(outputs, len(forces)):
        shown[..., i] = np.where(measured, change / np.asarray(view.sigma), 0.0)
    return Columns(shown, forcing)


def _effect_columns(view: View, effects: Sequence[AbstractEffect]) -> list[list[np.ndarray]]:
    """Each column of each effect, a force or a change of the channels."""
    tried = []
    for effect in effects:
        names = amplitudes(effect)
        more = {field: value * (1.0 + _NUDGE) for field, value in numbers(effect).items()}
        small = [with_numbers(effect, {name: _SMALL * (name == own) for name in names}) for own in names]
        tried.append(small or [effect, with_numbers(effect, more)])
    made = iter(differences(view, [one for own in tried for one in own]))
    columns = []
    for effect, own in zip(effects, tried, strict=True):
        found = [next(made) for _ in own]
        slopes = amplitudes(effect)
        columns.append([c / _SMALL for c in found] if slopes else [found[0], (found[1] - found[0]) / _NUDGE])
    return columns


@quietly
def differences(view: View, effects: Sequence[AbstractEffect]) -> list[np.ndarray]:
    """What each of `effects` adds with its own parameters: a force (2, R, K-1, n), or to the channels (R, K, c)."""
    vehicle, path = view.vehicle, view.path
    forces = iter(actuator_forces(vehicle, path, [e for e in effects if isinstance(e, AbstractActuator)]))
    flows = iter(flow_forces(vehicle, path, [e for e in effects if isinstance(e, AbstractFlow)]))
    memories = [effect for effect in effects if isinstance(effect, AbstractMemory)]
    remembered = iter(with_memories(memories, path.start, path.end, path.steps))

    def added(effect: AbstractEffect) -> np.ndarray:
        if isinstance(effect, AbstractActuator):
            return next(forces)
        if isinstance(effect, AbstractFlow):
            return next(flows)
        if isinstance(effect, AbstractForce):
            ends = next(remembered) if isinstance(effect, AbstractMemory) else (path.start, path.end)
            return np.stack([stacked_force(vehicle, effect, motion) for motion in ends])
        assert isinstance(effect, AbstractInstrument)
        channels = vehicle.layout.channels
        change = np.zeros((*path.times.shape, len(channels)))
        for channel, part in sensor_changes(path, effect).items():
            change[..., channels.index(channel)] = part
        return change

    return [added(effect) for effect in effects]


def stacked_force(vehicle: AbstractVehicle, effect: AbstractForce, motion: Motion) -> np.ndarray:
    """The effect's force on the free equations along a motion."""
    plain = jax.tree.map(np.asarray, effect)
    parts = plain.force(motion)
    like = motion.rates[vehicle.layout.equations[0]]
    return np.stack([np.broadcast_to(parts.get(e, 0.0), like.shape) for e in vehicle.layout.equations], axis=-1)


def flow_forces(vehicle: AbstractVehicle, path: Trajectory, effects: Sequence[AbstractFlow]) -> list[np.ndarray]:
    """What the moving water of each effect changes of the vehicle's force, at both ends of each interval."""
    ends = []
    for motion in (path.start, path.end) if effects else ():
        water = motion.water or dict.fromkeys(EQUATIONS[:3], 0.0 * motion.rates["surge"])
        motion = dataclasses.replace(motion, water=water)
        ends.append((motion, np.asarray(_force(vehicle, motion))))

    def added(effect: AbstractFlow, motion: Motion, force: np.ndarray) -> np.ndarray:
        parts = jax.tree.map(np.asarray, effect).water(motion.positions)
        water = {e: motion.water[e] + part for e, part in zip(motion.water, parts, strict=True)}
        return np.asarray(_force(vehicle, dataclasses.replace(motion, water=water))) - force

    return [np.stack([added(effect, *end) for end in ends]) for effect in effects]


def actuator_forces(
    vehicle: AbstractVehicle, path: Trajectory, effects: Sequence[AbstractActuator]
) -> list[np.ndarray]:
    """The force that each changed actuator adds, as the line over each interval with the same mean and slope."""
    inputs = [name for name, _ in vehicle.layout.inputs]
    # which actuator it is makes no difference to how it responds, and would make one to the compiler
    alike = stacked([dataclasses.replace(effect, actuator="") for effect in effects])
    commands = [np.stack([path.nodes[..., inputs.index(effects[i].actuator)] for i in own]) for own, _ in alike]
    after = _respond([stack for _, stack in alike], path.times, commands) if alike else []
    found: dict[int, np.ndarray] = {}
    for (own, _), nodes in zip(alike, after, strict=True):
        found |= dict(zip(own, np.asarray(nodes), strict=True))
    ends = [(motion, np.asarray(_force(vehicle, motion))) for motion in (path.start, path.end)] if alike else []
    forces = []
    for i, effect in enumerate(effects):
        start, middle, end = np.moveaxis(found[i], -1, 0)
        mean, slope = (start + 4.0 * middle + end) / 6.0, end - start
        added = []
        for (motion, force), value in zip(ends, (mean - 0.5 * slope, mean + 0.5 * slope), strict=True):
            changed = eqx.tree_at(lambda m, name=effect.actuator: m.actuators[name], motion, value)
            added.append(np.asarray(_force(vehicle, changed)) - force)
        forces.append(np.stack(added))
    return forces


@compiled
def _force(vehicle: AbstractVehicle, motion: Motion) -> Array:
    return vehicle.force(motion)


@compiled
def _respond(stacks: list[AbstractActuator], times: Values, nodes: Sequence[Values]) -> list[Array]:
    """What the actuators of each stack do at their `nodes` (N, R, K-1, 3), one program for all of them."""
    one = lambda effect, nodes: jax.vmap(effect.respond)(times, nodes)
    return [jax.vmap(one)(stack, own) for stack, own in zip(stacks, nodes, strict=True)]


def plausible(view: View, effect: AbstractEffect) -> bool:
    """Whether a sensor's error is smaller than what the sensor shows: a larger one is no sensor error but a way out.

    Of what it should show and what was measured, whichever is more. Not so on an arm within its reach: there a log
    feels mostly the turning, and a model that followed it believes that the vehicle moved so.
    """
    if not isinstance(effect, AbstractInstrument):
        return True
    if effect.reach is not None:
        return all(
            abs(numbers(effect)[name]) <= effect.reach * view.vehicle.layout.length for name in amplitudes(effect)
        )

    def shown(channel: str) -> float:
        measured = view.measured(channel)
        return float(max(np.ptp(view.path.true[channel]), np.ptp(measured))) if measured.size else 0.0

    return all(float(np.ptp(part)) <= shown(channel) for channel, part in sensor_changes(view.path, effect).items())


def sensor_changes(path: Trajectory, effect: AbstractInstrument) -> dict[str, np.ndarray]:
    """What a sensor effect changes in each of its channels, (R, K)."""
    plain = jax.tree.map(np.asarray, effect)
    shown = plain.show(path.times, path.true, path.seen)
    return {channel: np.asarray(part) - path.true[channel] for channel, part in shown.items()}
