"""What each candidate effect adds to the next sample, per unit of its amplitude, along the motion that took place."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from ...arrays import Values, aligned_zeros, quietly
from ...effects import (
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
from ...likelihood import Columns, by_readings, padded_width
from ...programs import compiled
from ...simulation import Trajectory
from ...vehicle import AbstractVehicle
from .prescribed import on_prescribed, prescribed_change, prescribed_slopes
from .view import View

# amplitude of an effect by which its slope is taken, SI: effects are linear in theirs, some only about zero
_SMALL = 1e-3
# by how much a shape such as a lag is moved to see which way the data would have it
_NUDGE = 0.1
# forces of which columns are made at once
_AT_ONCE = 64


class Part(NamedTuple):
    """A column where it acts: a force at both ends of each interval, or a change of channels, SI.

    **Fields**

    - `at`: (m,) the equations or channels. `value`: (2, R, K-1, m) or (R, K, m) what it is there.
    - `step`: (R, K-1, s) what it adds to each step of the state beside a change of channels, if it is no force.
    """

    at: np.ndarray
    value: np.ndarray
    step: np.ndarray | None = None

    @classmethod
    def of(cls, whole: np.ndarray, step: np.ndarray | None = None) -> "Part":
        """Of a column in all equations, or channels, the last axis."""
        at = np.flatnonzero(whole.reshape(-1, whole.shape[-1]).any(axis=0))
        return cls(at, np.ascontiguousarray(whole[..., at]), step)

    @property
    def is_force(self) -> bool:
        """Whether it is a force, and no change of channels."""
        return self.value.ndim == 4


@dataclasses.dataclass(frozen=True)
class EffectColumns:
    """Columns of effects along the motion of a view, kept where they act.

    Side by side in all states and channels hundreds of them take several times as much memory.
    """

    view: View
    parts: tuple[Part, ...]

    def __len__(self) -> int:
        return len(self.parts)

    def __add__(self, more: "EffectColumns") -> "EffectColumns":
        """These and `more` of the same view after them."""
        return dataclasses.replace(self, parts=self.parts + more.parts)

    def picked(self, chosen: Sequence[int]) -> "EffectColumns":
        """Some of the columns, in that order."""
        return dataclasses.replace(self, parts=tuple(self.parts[i] for i in chosen))

    def dense(self) -> Columns:
        """The columns side by side, forces as what the view's system makes of them in each step."""
        system = self.view.followed.system
        made = Columns(np.zeros((*system.C.shape[:3], len(self))), np.zeros((*system.A.shape[:3], len(self))))
        self.write(made, slice(None))
        return made

    def placed(self, runs: slice) -> Columns:
        """The view's own columns and these in a share of the runs, padded to the width of a program.

        They are placed where programs take them from, copied once. What a share has beyond the last run is empty.
        """
        known, size = len(self.view.prior), runs.stop - runs.start

        def beside(own: np.ndarray) -> np.ndarray:
            whole = aligned_zeros((size, *own.shape[1:3], padded_width(known + len(self))))
            whole[: len(own[runs]), ..., :known] = own[runs]
            return whole

        made = jax.tree.map(beside, self.view.base)
        there = len(self.view.base.shown[runs])
        self.write(jax.tree.map(lambda M: M[:there, ..., known : known + len(self)], made), runs)
        return jax.tree.map(jax.device_put, made)

    def write(self, onto: Columns, runs: slice) -> None:
        """Write what some of the runs have of the columns into zeros, a few at a time since copies take memory."""
        system, sigma, forcing = self.view.followed.system, np.asarray(self.view.sigma), onto.forcing
        assert forcing is not None
        # by NumPy: to cut arrays of JAX would be a program for each place
        G, measured = np.asarray(system.G)[runs], np.asarray(system.measured)[runs]
        readings = np.asarray(self.view.followed.readings)[runs]
        forces = [i for i, part in enumerate(self.parts) if part.is_force]
        for first in range(0, len(forces), _AT_ONCE):
            some = forces[first : first + _AT_ONCE]
            ends = np.zeros((2, *G.shape[:2], G.shape[-1] // 2, len(some)))
            for place, i in enumerate(some):
                ends[..., self.parts[i].at, place] = self.parts[i].value[:, runs]
            forcing[..., some] = G @ np.concatenate([*ends], axis=2)
        for i, (at, value, step) in enumerate(self.parts):
            if not self.parts[i].is_force:
                shown = by_readings(value[runs], readings[..., at]) / sigma[at]
                onto.shown[..., at, i] = np.where(measured[..., at], shown, 0.0)
            if step is not None:
                # numbers that differ by run may be states after the vehicle's own
                forcing[:, :, : step.shape[-1], i] = step[runs]


def candidate_columns(view: View, candidates: Sequence[AbstractEffect]) -> tuple[EffectColumns, list[list[int]]]:
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
    return EffectColumns(view, (*forces, *outputs)), owners


def columns_of(view: View, forces: Iterable[np.ndarray], outputs: Iterable[np.ndarray] = ()) -> EffectColumns:
    """Columns of forces at both ends of each interval, (2, R, K-1, n), then of changes of channels, (R, K, c), SI.

    One after the other, since in all equations or channels they take several times the memory.
    """
    return EffectColumns(view, tuple(map(Part.of, itertools.chain(forces, outputs))))


def prescribed_columns(view: View, effects: Sequence[AbstractEffect]) -> EffectColumns:
    """Columns of effects on prescribed motions with their own parameters."""
    sizes = [sum(numbers(effect).values()) for effect in effects]
    slopes = zip(sizes, prescribed_slopes(view, effects), strict=True)
    return EffectColumns(view, tuple(Part.of(size * shown, size * step) for size, (step, shown) in slopes))


@quietly
def _effect_columns(view: View, effects: Sequence[AbstractEffect]) -> list[list[Part]]:
    """Each column of each effect, a force or a change of the channels."""
    before = [effect for effect in effects if on_prescribed(effect, view.vehicle)]
    slopes_before = iter(prescribed_slopes(view, before))
    tried = []
    for effect in effects:
        if on_prescribed(effect, view.vehicle):
            tried.append([])
            continue
        names = amplitudes(effect)
        more = {field: value * (1.0 + _NUDGE) for field, value in numbers(effect).items()}
        small = [with_numbers(effect, {name: _SMALL * (name == own) for name in names}) for own in names]
        tried.append(small or [effect, with_numbers(effect, more)])
    # one after the other: only where they act are they kept
    made = _differences(view, [one for own in tried for one in own])
    columns = []
    for effect, own in zip(effects, tried, strict=True):
        if not own:
            step, shown = next(slopes_before)
            columns.append([Part.of(shown, step)])
            continue
        found = [next(made) for _ in own]
        slopes = amplitudes(effect)
        own = [c / _SMALL for c in found] if slopes else [found[0], (found[1] - found[0]) / _NUDGE]
        columns.append([Part.of(column) for column in own])
    return columns


@quietly
def differences(view: View, effects: Sequence[AbstractEffect]) -> list[np.ndarray]:
    """What each of `effects` adds with its own parameters: a force (2, R, K-1, n), or to the channels (R, K, c)."""
    return list(_differences(view, effects))


def _differences(view: View, effects: Sequence[AbstractEffect]) -> Iterator[np.ndarray]:
    """`differences`, one when it is asked for."""
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

    return map(added, effects)


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

    if on_prescribed(effect, view.vehicle):
        change, motion = prescribed_change(view, effect)
        # its motion is the vehicle's: an attitude that is off by more than it varies is not what was steered by
        return float(np.max(np.abs(change))) <= float(np.ptp(motion))

    def shown(channel: str) -> float:
        measured = view.measured(channel)
        return float(max(np.ptp(view.path.true[channel]), np.ptp(measured))) if measured.size else 0.0

    return all(float(np.ptp(part)) <= shown(channel) for channel, part in sensor_changes(view.path, effect).items())


def sensor_changes(path: Trajectory, effect: AbstractInstrument) -> dict[str, np.ndarray]:
    """What a sensor effect changes in each of its channels, (R, K)."""
    plain = jax.tree.map(np.asarray, effect)
    shown = plain.show(path.times, path.true, path.seen)
    return {channel: np.asarray(part) - path.true[channel] for channel, part in shown.items()}
