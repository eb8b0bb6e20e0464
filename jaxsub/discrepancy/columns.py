"""What each candidate effect adds to the next sample, per unit of its amplitude, along the motion that took place."""

import dataclasses
import itertools
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..effects import (
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractInstrument,
    AbstractMemory,
    Motion,
    amplitudes,
    numbers,
    with_memory,
    with_numbers,
)
from ..likelihood import Columns
from ..vehicle import AbstractVehicle
from .view import Trajectory, View

# by how much a shape such as a lag is moved to see which way the data would have it
_NUDGE = 0.1


def candidate_columns(view: View, candidates: Sequence[AbstractEffect]) -> tuple[Columns, list[list[int]]]:
    """The columns of all candidates, and which of them each candidate has.

    An effect with amplitudes has a column for each. One with none, such as a lag, enters as the whole difference that
    it makes at its grid value, and the difference that a little more of it would make.
    """
    made = [_effect_columns(view, effect) for effect in candidates]
    shows = [isinstance(effect, AbstractInstrument) for effect in candidates]
    of_sort = lambda shown: [c for own, kind in zip(made, shows, strict=True) if kind is shown for c in own]
    forces, outputs = of_sort(False), of_sort(True)
    # forces come first
    free = {False: itertools.count(), True: itertools.count(len(forces))}
    owners = [[next(free[kind]) for _ in own] for own, kind in zip(made, shows, strict=True)]
    return force_columns(view, forces) + output_columns(view, outputs), owners


def force_columns(view: View, forces: Sequence[np.ndarray]) -> Columns:
    """Columns of generalised forces given at both ends of each interval, (2, R, K-1, n) each."""
    system = view.followed.system
    if not forces:
        return Columns(jnp.zeros((*system.C.shape[:3], 0)), jnp.zeros((*system.A.shape[:3], 0)))
    ends = jnp.asarray(np.stack(forces, axis=-1))
    forcing = system.G @ jnp.concatenate([ends[0], ends[1]], axis=2)
    return Columns(jnp.zeros((*system.C.shape[:3], len(forces))), forcing)


def output_columns(view: View, outputs: Sequence[np.ndarray]) -> Columns:
    """Columns of changes of the channels, (R, K, c) each, SI."""
    system = view.followed.system
    if not outputs:
        return force_columns(view, [])
    shown = jnp.asarray(np.stack(outputs, axis=-1)) / view.sigma[:, None]
    shown = jnp.where(system.measured[..., None], shown, 0.0)
    return Columns(shown, jnp.zeros((*system.A.shape[:3], len(outputs))))


def _effect_columns(view: View, effect: AbstractEffect) -> list[np.ndarray]:
    """Each column of an effect, a force or a change of the channels."""
    names = amplitudes(effect)
    if names:
        units = [with_numbers(effect, {name: float(name == own) for name in names}) for own in names]
        return [difference(view, unit) for unit in units]
    at = difference(view, effect)
    more = {field: value * (1.0 + _NUDGE) for field, value in numbers(effect).items()}
    return [at, (difference(view, with_numbers(effect, more)) - at) / _NUDGE]


def difference(view: View, effect: AbstractEffect) -> np.ndarray:
    """What an effect as it stands adds: a force (2, R, K-1, n), or to the channels (R, K, c)."""
    vehicle, path = view.vehicle, view.path
    if isinstance(effect, AbstractActuator):
        return actuator_force(vehicle, path, effect)
    if isinstance(effect, AbstractForce):
        ends = (path.start, path.end)
        if isinstance(effect, AbstractMemory):
            ends = with_memory(effect, *ends, path.steps)
        return np.stack([stacked_force(vehicle, effect, motion) for motion in ends])
    assert isinstance(effect, AbstractInstrument)
    channels = vehicle.layout.channels
    change = np.zeros((*path.times.shape, len(channels)))
    for channel, part in sensor_changes(path, effect).items():
        change[..., channels.index(channel)] = part
    return change


def stacked_force(vehicle: AbstractVehicle, effect: AbstractForce, motion: Motion) -> np.ndarray:
    """The effect's force on the free equations along a motion."""
    plain = jax.tree.map(np.asarray, effect)
    parts = plain.force(motion)
    like = motion.rates[vehicle.layout.equations[0]]
    return np.stack([np.broadcast_to(parts.get(e, 0.0), like.shape) for e in vehicle.layout.equations], axis=-1)


def actuator_force(vehicle: AbstractVehicle, path: Trajectory, effect: AbstractActuator) -> np.ndarray:
    """The force that a changed actuator adds, as the line over each interval with the same mean and slope."""
    column = [name for name, _ in vehicle.layout.inputs].index(effect.actuator)
    # which actuator it is makes no difference to how it responds, and would make one to the compiler
    nameless = dataclasses.replace(effect, actuator="")
    after = np.asarray(_respond(nameless, jnp.asarray(path.times), jnp.asarray(path.nodes[..., column])))
    start, middle, end = np.moveaxis(after, -1, 0)
    mean, slope = (start + 4.0 * middle + end) / 6.0, end - start
    ends = []
    for motion, value in ((path.start, mean - 0.5 * slope), (path.end, mean + 0.5 * slope)):
        changed = eqx.tree_at(lambda m: m.actuators[effect.actuator], motion, value)
        ends.append(np.asarray(_force(vehicle, changed)) - np.asarray(_force(vehicle, motion)))
    return np.stack(ends)


@eqx.filter_jit
def _force(vehicle: AbstractVehicle, motion: Motion) -> Array:
    return vehicle.force(motion)


@eqx.filter_jit
def _respond(effect: AbstractActuator, times: Array, nodes: Array) -> Array:
    return jax.vmap(effect.respond)(times, nodes)


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
    shown = effect.show(jnp.asarray(path.times), path.true, path.seen)
    return {channel: np.asarray(part) - path.true[channel] for channel, part in shown.items()}
