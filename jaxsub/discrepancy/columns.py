"""What each candidate effect would add to the outputs, per unit of its amplitude, along the fitted trajectory."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import (
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractSensor,
    Facts,
    Motion,
    amplitudes,
    with_numbers,
)
from ..estimate import Fit
from ..likelihood import force_columns
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle


class Trajectory(eqx.Module):
    """The fitted motion at both ends of every sample interval, as NumPy arrays: what effects are evaluated on.

    NumPy on purpose: a force is a handful of array operations, so a vocabulary of any size costs no compilation.
    """

    start: Motion
    end: Motion
    nodes: np.ndarray
    outputs: np.ndarray

    @classmethod
    def of(cls, fit: Fit) -> "Trajectory":
        """The trajectory of a fit."""
        vehicle, runs, states = fit.vehicle, fit.runs, fit.model.states
        nodes, outputs, start, end = _trajectory(vehicle, runs, states)
        plain = lambda tree: jax.tree.map(np.asarray, tree)
        return cls(plain(start), plain(end), np.asarray(nodes), np.asarray(outputs))


@eqx.filter_jit
def _trajectory(vehicle: AbstractVehicle, runs: Runs, states: Array) -> tuple[Array, Array, Motion, Motion]:
    nodes = jax.vmap(vehicle.actuate)(runs.times, runs.nodes())
    start = vehicle.motion(states[:, :-1], nodes[:, :, 0])
    end = vehicle.motion(states[:, 1:], nodes[:, :, 2])
    return nodes, vehicle.measure(runs.times, states, runs.signals), start, end


def facts(vehicle: AbstractVehicle, fit: Fit) -> Facts:
    """What the vocabulary needs to know to list its candidates."""
    layout = vehicle.layout
    n = len(layout.equations)
    scale = np.sqrt(np.mean(np.asarray(fit.model.states[..., :n]) ** 2, axis=(0, 1)))
    return Facts(
        layout.kind,
        layout.equations,
        tuple(name for name, _ in layout.inputs),
        layout.channels,
        tuple(name for name, _ in layout.environment),
        layout.length,
        layout.diameter,
        dict(zip(layout.equations, np.maximum(scale, 1e-9).tolist(), strict=True)),
        float(np.median(np.asarray(fit.runs.steps)[np.asarray(fit.runs.step_of)[np.asarray(fit.runs.live)]])),
    )


def candidate_columns(
    fit: Fit, path: Trajectory, candidates: Sequence[AbstractEffect]
) -> tuple[Float[Array, "r k c q"], list[int]]:
    """Output change per unit of each amplitude of each candidate (SI), and which candidate each column belongs to.

    A force is evaluated along the stored trajectory and pushed through the model's linear recursion; an effect with no
    amplitude, such as a lag, enters as the whole difference that it makes at its grid value.
    """
    owners, forces, shown = [], [], []
    order = [i for i, e in enumerate(candidates) if not isinstance(e, AbstractSensor)]
    for i in order:
        for column in unit_forces(fit.vehicle, path, fit, candidates[i]):
            owners.append(i)
            forces.append(column)
    for i, effect in enumerate(candidates):
        if isinstance(effect, AbstractSensor):
            owners.append(i)
            shown.append(_unit_sensor(fit, path, effect))
    parts = []
    if forces:
        ends = np.stack(forces, axis=-1)  # (2, r, k-1, n, q)
        parts.append(force_columns(fit.model, jnp.asarray(ends[0]), jnp.asarray(ends[1])))
    if shown:
        parts.append(jnp.asarray(np.stack(shown, axis=-1)))
    return jnp.concatenate(parts, axis=-1), owners


def unit_forces(vehicle: AbstractVehicle, path: Trajectory, fit: Fit, effect: AbstractEffect) -> list[np.ndarray]:
    """The generalised force per unit of each amplitude at both ends of each interval: arrays (2, R, K-1, n)."""
    if isinstance(effect, AbstractActuator):
        return [_actuator_force(vehicle, path, fit, effect)]
    assert isinstance(effect, AbstractForce)
    names = amplitudes(effect)
    units = [with_numbers(effect, {name: float(name == own) for name in names}) for own in names]
    return [np.stack([stacked_force(vehicle, unit, motion) for motion in (path.start, path.end)]) for unit in units]


def stacked_force(vehicle: AbstractVehicle, effect: AbstractForce, motion: Motion) -> np.ndarray:
    """The effect's force on the free equations along a motion."""
    plain = jax.tree.map(np.asarray, effect)
    parts = plain.force(motion)
    like = motion.rates[vehicle.layout.equations[0]]
    return np.stack([np.broadcast_to(parts.get(e, 0.0), like.shape) for e in vehicle.layout.equations], axis=-1)


def _actuator_force(vehicle: AbstractVehicle, path: Trajectory, fit: Fit, effect: AbstractActuator) -> np.ndarray:
    """The force that a changed actuator adds, as the line over each interval with the same mean and slope."""
    column = [name for name, _ in vehicle.layout.inputs].index(effect.actuator)
    before = path.nodes[..., column]
    after = np.asarray(_respond(effect, fit.runs.times, jnp.asarray(before)))
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


def _unit_sensor(fit: Fit, path: Trajectory, effect: AbstractSensor) -> np.ndarray:
    """The change of the outputs per unit of a sensor effect's amplitude, (R, K, c)."""
    (name,) = amplitudes(effect)
    column = np.zeros_like(path.outputs)
    column[..., fit.vehicle.layout.channels.index(effect.channel)] = sensor_change(
        fit, path, with_numbers(effect, {name: 1.0})
    )[0]
    return column


def sensor_change(fit: Fit, path: Trajectory, effect: AbstractSensor) -> tuple[np.ndarray, np.ndarray]:
    """What a sensor effect changes in its channel, and the channel without it, (R, K) each."""
    true = path.outputs[..., fit.vehicle.layout.channels.index(effect.channel)]
    return np.asarray(effect.measure(fit.runs.times, jnp.asarray(true))) - true, true
