"""The generator's own integrator: Runge-Kutta steps, many to a sample, of the vehicle and what it conceals."""

import functools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from jaxsub.vehicle import AbstractVehicle

from .autopilot import command
from .bodies import INTERVAL
from .truth import Moment, Truth

STEPS = 10


class Drive(NamedTuple):
    """What acts on R runs: start (R, s), commands (R, K-1, m) held, pushes (R, K, n) linear between samples.

    So are motions that the file prescribes, `prescribed` (R, K, c), if it has any. Samples are `interval` s apart.
    """

    start: Array
    commands: Array
    push: Array
    prescribed: Array | None = None
    interval: float = INTERVAL

    def of(self, runs: slice) -> "Drive":
        """Of some of the runs."""
        prescribed = None if self.prescribed is None else self.prescribed[runs]
        return Drive(self.start[runs], self.commands[runs], self.push[runs], prescribed, self.interval)


@eqx.filter_jit
def states(
    vehicle: AbstractVehicle, truths: tuple[Truth, ...], sizes: Array, drive: Drive, steps: int = STEPS
) -> Array:
    """States at the samples, (R, K, s), of `vehicle` with `truths` of `sizes`."""
    h = drive.interval / steps

    def run(start: Array, commands: Array, push: Array, prescribed: Array | None) -> Array:
        moving = None if prescribed is None else lambda t: _at(t / drive.interval, prescribed)
        sample = _sample(vehicle, truths, sizes, h, moving)
        held = jnp.repeat(commands, steps, axis=0)
        held = _deflections(vehicle, truths, sizes, held, h)
        part = jnp.arange(len(held) + 1) / steps
        fine = _at(part, push)
        grouped = (h * jnp.arange(len(held)), held, fine[:-1], fine[1:])
        grouped = jax.tree.map(lambda x: x.reshape(-1, steps, *x.shape[1:]), grouped)
        begin = _begin(truths, start)

        def one(state: Array, inputs: tuple) -> tuple[Array, Array]:
            after = sample(state, inputs)
            return after, after

        after = jax.lax.scan(one, begin, grouped)[1]
        return jnp.concatenate([begin[None], after])[:, : len(start)]

    return jax.vmap(run)(*drive[:-1])


def _at(place: Array, values: Array) -> Array:
    """`values` (K, n) at a place among their samples, between which they are linear."""
    return jax.vmap(lambda column: jnp.interp(place, jnp.arange(len(values)), column), 1, -1)(values)


@eqx.filter_jit
def steered(
    vehicle: AbstractVehicle, truths: tuple[Truth, ...], sizes: Array, start: Array, wanted: Array, errors: Array
) -> Array:
    """Commands of the autopilot (R, K, m) that keeps `wanted` (R, K, 4) by sensors with `errors` (R, K, c).

    Those of a sample follow from what the sensors show at it. Actuators and sensors need all samples before, so each
    is worked out anew from those.
    """
    h = INTERVAL / STEPS
    sample, calm = _sample(vehicle, truths, sizes, h), jnp.zeros((STEPS, len(vehicle.layout.equations)))

    def run(start: Array, wanted: Array, errors: Array) -> Array:
        begin, count = _begin(truths, start), len(wanted)

        def one(k: Array, carry: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
            now, moved, commands = carry
            moved = moved.at[k].set(now[: len(start)])
            shown = _shown(vehicle, truths, sizes, moved, commands[:-1], None, INTERVAL)[k] + errors[k]
            commands = commands.at[k].set(command(wanted[k], dict(zip(vehicle.layout.channels, shown, strict=True))))
            held = _deflections(vehicle, truths, sizes, jnp.repeat(commands, STEPS, axis=0), h)
            held = jax.lax.dynamic_slice_in_dim(held, k * STEPS, STEPS)
            t = h * (k * STEPS + jnp.arange(STEPS))
            return sample(now, (t, held, calm, calm)), moved, commands

        moved = jnp.repeat(start[None], count, axis=0)
        commands = jnp.zeros((count, len(vehicle.layout.inputs)))
        return jax.lax.fori_loop(0, count, one, (begin, moved, commands))[2]

    return jax.lax.map(lambda run_of: run(*run_of), (start, wanted, errors))


def _begin(truths: tuple[Truth, ...], start: Array) -> Array:
    """A state and the truths' own after it."""
    return jnp.concatenate([start, jnp.zeros(sum(truth.memory for truth in truths))])


def _sample(
    vehicle: AbstractVehicle,
    truths: tuple[Truth, ...],
    sizes: Array,
    h: float,
    moving: Callable[[Array], Array] | None = None,
):
    """The state a sample later, by steps of h s: their times, deflections, and pushes at their ends.

    `moving` gives the prescribed motions at a time, if there are any.
    """
    n = len(vehicle.layout.equations)
    inverse, damping = jnp.linalg.inv(vehicle.mass_matrix()), vehicle.damping_matrix()
    still = jnp.zeros(len(vehicle.layout.environment))
    count = sum(truth.memory for truth in truths)

    def rates(t: Array, state: Array, deflected: Array, push: Array) -> Array:
        own, memory = state[: state.shape[0] - count], state[state.shape[0] - count :]
        around = still if moving is None else jnp.concatenate([moving(t), still])
        motion = vehicle.motion(own, jnp.concatenate([deflected, around, t[None]]))
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
        positions = jnp.asarray([moved[p] for p in vehicle.layout.positions])
        return jnp.concatenate([inverse @ force, positions, *memory_rates])

    def step(state: Array, inputs: tuple[Array, Array, Array, Array]) -> tuple[Array, None]:
        t, deflected, low, high = inputs
        middle = 0.5 * (low + high)
        k1 = rates(t, state, deflected, low)
        k2 = rates(t + h / 2, state + h / 2 * k1, deflected, middle)
        k3 = rates(t + h / 2, state + h / 2 * k2, deflected, middle)
        k4 = rates(t + h, state + h * k3, deflected, high)
        return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), None

    return lambda state, inputs: jax.lax.scan(step, state, inputs)[0]


def _deflections(vehicle: AbstractVehicle, truths: Sequence[Truth], sizes: Array, held: Array, h: float) -> Array:
    names = [name for name, _ in vehicle.layout.inputs]
    for truth, size in zip(truths, sizes, strict=True):
        if truth.command is not None and truth.actuator is not None:
            column = names.index(truth.actuator)
            held = held.at[:, column].set(truth.command(size, h, held[:, column]))
    return held


def _shown(
    vehicle: AbstractVehicle,
    truths: tuple[Truth, ...],
    sizes: Array,
    state: Array,
    commands: Array,
    prescribed: Array | None,
    interval: float,
) -> Array:
    """Channels of one run, (K, c)."""
    t = interval * jnp.arange(len(state))
    held = jnp.concatenate([commands, commands[-1:]])
    beside = [] if prescribed is None else [prescribed]
    signals = [held, *beside, jnp.zeros((len(t), len(vehicle.layout.environment))), t[:, None]]
    motion = vehicle.motion(state, jnp.concatenate(signals, axis=1))
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
    show = functools.partial(_shown, vehicle, truths, sizes, interval=drive.interval)
    shown = jax.vmap(show)(moved, drive.commands, prescribed=drive.prescribed)
    return shown, moved
