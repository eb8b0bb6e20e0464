"""The generator's own integrator: Runge-Kutta steps, many to a sample, of the vehicle and what it conceals."""

import functools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from jaxsub.vehicle import AbstractVehicle

from .bodies import INTERVAL
from .truth import Moment, Truth

STEPS = 10


class Drive(NamedTuple):
    """What acts on R runs: start (R, s), commands (R, K-1, m) held, pushes (R, K, n) linear between samples."""

    start: Array
    commands: Array
    push: Array


@eqx.filter_jit
def states(
    vehicle: AbstractVehicle, truths: tuple[Truth, ...], sizes: Array, drive: Drive, steps: int = STEPS
) -> Array:
    """States at the samples, (R, K, s), of `vehicle` with `truths` of `sizes`."""
    h = INTERVAL / steps
    n = len(vehicle.layout.equations)
    inverse, damping = jnp.linalg.inv(vehicle.mass_matrix()), vehicle.damping_matrix()
    extra = len(vehicle.layout.environment)
    count = sum(truth.memory for truth in truths)

    def rates(t: Array, state: Array, command: Array, push: Array) -> Array:
        own, memory = state[: state.shape[0] - count], state[state.shape[0] - count :]
        motion = vehicle.motion(own, jnp.concatenate([command, jnp.zeros(extra), t[None]]))
        force = vehicle.force(motion) + damping @ own[:n] + push
        memory_rates, at = [], 0
        for truth, size in zip(truths, sizes, strict=True):
            moment = Moment(t, motion, memory[at : at + truth.memory], damping)
            at += truth.memory
            if truth.force is not None:
                felt = truth.force(size, moment)
                force = force + jnp.stack([jnp.asarray(felt.get(e, 0.0)) for e in vehicle.layout.equations])
            if truth.memory_rates is not None:
                memory_rates.append(truth.memory_rates(size, moment))
        moved = vehicle.position_rates(motion)
        positions = jnp.stack([moved[p] for p in vehicle.layout.positions])
        return jnp.concatenate([inverse @ force, positions, *memory_rates])

    def step(state: Array, inputs: tuple[Array, Array, Array, Array]) -> tuple[Array, None]:
        t, command, low, high = inputs
        middle = 0.5 * (low + high)
        k1 = rates(t, state, command, low)
        k2 = rates(t + h / 2, state + h / 2 * k1, command, middle)
        k3 = rates(t + h / 2, state + h / 2 * k2, command, middle)
        k4 = rates(t + h, state + h * k3, command, high)
        return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), None

    def run(start: Array, commands: Array, push: Array) -> Array:
        held = jnp.repeat(commands, steps, axis=0)
        held = _deflections(vehicle, truths, sizes, held, h)
        part = jnp.arange(len(held) + 1) / steps
        fine = jax.vmap(lambda p: jnp.interp(part, jnp.arange(len(push)), p), 1, 1)(push)
        grouped = (h * jnp.arange(len(held)), held, fine[:-1], fine[1:])
        grouped = jax.tree.map(lambda x: x.reshape(-1, steps, *x.shape[1:]), grouped)

        def sample(state: Array, inputs: tuple) -> tuple[Array, Array]:
            after = jax.lax.scan(step, state, inputs)[0]
            return after, after

        begin = jnp.concatenate([start, jnp.zeros(count)])
        after = jax.lax.scan(sample, begin, grouped)[1]
        return jnp.concatenate([begin[None], after])[:, : len(start)]

    return jax.vmap(run)(*drive)


def _deflections(vehicle: AbstractVehicle, truths: Sequence[Truth], sizes: Array, held: Array, h: float) -> Array:
    names = [name for name, _ in vehicle.layout.inputs]
    for truth, size in zip(truths, sizes, strict=True):
        if truth.command is not None and truth.actuator is not None:
            column = names.index(truth.actuator)
            held = held.at[:, column].set(truth.command(size, h, held[:, column]))
    return held


def _shown(vehicle: AbstractVehicle, truths: tuple[Truth, ...], sizes: Array, state: Array, commands: Array) -> Array:
    """Channels of one run, (K, c)."""
    t = INTERVAL * jnp.arange(len(state))
    held = jnp.concatenate([commands, commands[-1:]])
    surroundings = jnp.zeros((len(t), len(vehicle.layout.environment)))
    motion = vehicle.motion(state, jnp.concatenate([held, surroundings, t[:, None]], axis=1))
    channels = {c: jnp.broadcast_to(y, t.shape) for c, y in vehicle.channels(motion).items()}
    for truth, size in zip(truths, sizes, strict=True):
        if truth.sense is not None:
            channels |= truth.sense(size, t, channels)
    return jnp.stack([channels[c] for c in vehicle.layout.channels], axis=1)


@eqx.filter_jit
def outputs(
    vehicle: AbstractVehicle, truths: tuple[Truth, ...], sizes: Array, drive: Drive, steps: int = STEPS
) -> tuple[Array, Array]:
    """What perfect sensors of that vehicle show, (R, K, c), and its states, (R, K, s)."""
    moved = states(vehicle, truths, sizes, drive, steps)
    shown = jax.vmap(functools.partial(_shown, vehicle, truths, sizes))(moved, drive.commands)
    return shown, moved
