r"""The model linearised along its trajectory, and the one recursion through which every question is asked.

A coefficient, an initial state, a candidate effect and an unknown force differ only in how they force
$D_{k+1} = A_k D_k + f_k$, so all of them go through it as columns of one batch. The Jacobians are exact derivatives of
the sampled step; nothing here depends on how many effects the vocabulary has.
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..effects import AbstractActuator, AbstractInstrument
from ..recording.runs import Runs
from ..simulate import Sampled
from ..vehicle import AbstractVehicle
from .output_error import residual_outputs

# samples whose Jacobians are taken at once
_AT_ONCE = 50_000


class Linearised(eqx.Module):
    """A model along its trajectory through R runs of K samples, s states, c channels, n equations, p free parameters.

    **Fields**

    - `states`: (R, K, s). `error`: (R, K, c) measured minus modelled, SI, zero where missing.
    - `A`: (R, K-1, s, s) of the step by the state. `G`: (R, K-1, s, 2n) by a force at its start and end.
    - `C`: (R, K, c, s) of the outputs by the state.
    - `theta`: (R, K, c, p) of the outputs by the free parameters; `start`: (R, K, c, s) by the run's initial state.
    """

    states: Float[Array, "r k s"]
    error: Float[Array, "r k c"]
    A: Float[Array, "r k1 s s"]
    G: Float[Array, "r k1 s n2"]
    C: Float[Array, "r k c s"]
    theta: Float[Array, "r k c p"]
    start: Float[Array, "r k c s"]


def propagate(
    A: Float[Array, "r k1 s s"], forcing: Float[Array, "r k1 s q"], start: Float[Array, "r s q"]
) -> Float[Array, "r k s q"]:
    """Solve D ← A D + forcing from `start`, q columns of R runs at once."""

    def advance(D: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        a, f = step
        D = a @ D + f
        return D, D

    swap = lambda leaf: jnp.swapaxes(leaf, 0, 1)
    following = jax.lax.scan(advance, start, (swap(A), swap(forcing)))[1]
    return jnp.concatenate([start[:, None], swap(following)], axis=1)


class Jacobians(eqx.Module):
    """Of a model's step and outputs, at given states.

    **Fields**

    - `A`, `G`, `C`: as of `Linearised`. `F`: (R, K-1, s, p) of the step by the free parameters.
    - `direct`: (R, K, c, p) of the outputs by the free parameters, the state held.
    """

    A: Float[Array, "r k1 s s"]
    G: Float[Array, "r k1 s n2"]
    C: Float[Array, "r k c s"]
    F: Float[Array, "r k1 s p"]
    direct: Float[Array, "r k c p"]


def jacobians(
    vehicle: AbstractVehicle,
    runs: Runs,
    before: Float[Array, "r k1 s"],
    at: Float[Array, "r k s"],
    push: Float[Array, "r k1 2 n"] | None = None,
) -> Jacobians:
    """The steps taken from the states `before`, under `push` if given, and the outputs `at` others."""
    names = [row.name for row in vehicle.layout.free]
    values = vehicle.values()
    theta = jnp.stack([values[name] for name in names]) if names else jnp.zeros(0)
    with_theta = lambda vector: vehicle.with_values(dict(zip(names, vector, strict=True)))
    r, k1, s = before.shape
    p, n = len(names), len(vehicle.layout.equations)
    flat = before.reshape(r * k1, s)
    pushes = jnp.zeros((len(flat), 2, n)) if push is None else push.reshape(-1, 2, n)
    index, live = runs.step_of.reshape(-1), runs.live.reshape(-1)[:, None, None]

    def stepped(change: Array) -> Array:
        parameters, moved, pushed = jnp.split(change, [p, p + s])
        model = Sampled.of(with_theta(theta + parameters), runs)
        nodes = jax.vmap(model.vehicle.actuate)(runs.times, runs.nodes())
        nodes = nodes.reshape(len(flat), 3, nodes.shape[-1])
        return jax.vmap(model.step)(flat + moved, nodes, index, pushes + pushed.reshape(2, n))

    def shown(change: Array) -> Array:
        parameters, moved = jnp.split(change, [p])
        return with_theta(theta + parameters).measure(runs.times, at + moved, runs.signals)

    F, A, G = jnp.split(_columns(stepped, jnp.zeros(p + s + 2 * n)), [p, p + s], axis=-1)
    A = jnp.where(live, A, jnp.eye(s)).reshape(r, k1, s, s)
    G, F = (jnp.where(live, M, 0.0).reshape(r, k1, s, M.shape[-1]) for M in (G, F))
    direct, C = jnp.split(_columns(shown, jnp.zeros(p + s)), [p], axis=-1)
    return Jacobians(A, G, C, F, direct)


def _jacobians_along(vehicle: AbstractVehicle, runs: Runs, states: Float[Array, "r k s"]) -> Jacobians:
    """`jacobians` along `states`; of long runs piece by piece, so that intermediate results take a piece's memory."""
    samples = states.shape[1]
    pieces = -(-samples * len(states) // _AT_ONCE)
    # an actuator's or a sensor's own dynamics need what came before a piece
    if pieces <= 1 or any(isinstance(effect, AbstractActuator | AbstractInstrument) for effect in vehicle.effects):
        return jacobians(vehicle, runs, states[:, :-1], states)
    length = -(-(samples - 1) // pieces)
    begins = length * jnp.arange(pieces)

    def piece(begin: Array) -> Jacobians:
        # the last begins earlier, so that all are of one length
        begin = jnp.minimum(begin, samples - 1 - length)
        cut = lambda array, more: jax.lax.dynamic_slice_in_dim(array, begin, length + more, axis=1)
        short = dataclasses.replace(
            runs,
            times=cut(runs.times, 1),
            step_of=cut(runs.step_of, 0),
            live=cut(runs.live, 0),
            signals=cut(runs.signals, 1),
            outputs=cut(runs.outputs, 1),
            mask=cut(runs.mask, 1),
        )
        at = cut(states, 1)
        return jacobians(vehicle, short, at[:, :-1], at)

    every = jax.lax.map(piece, begins)
    last = samples - 1 - length * (pieces - 1)

    def joined(parts: Array) -> Array:
        whole = jnp.moveaxis(parts[:-1, :, :length], 0, 1).reshape(len(states), -1, *parts.shape[3:])
        return jnp.concatenate([whole, parts[-1][:, length - last :]], axis=1)

    return jax.tree.map(joined, every)


@eqx.filter_jit
def linearise(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Linearised:
    """`vehicle` along its trajectory from the initial states `start`."""
    states = Sampled.of(vehicle, runs).states(runs, start)
    by = _jacobians_along(vehicle, runs, states)
    r, k1, s, p = by.F.shape
    forcing = jnp.concatenate([by.F, jnp.zeros((r, k1, s, s))], axis=-1)
    origin = jnp.broadcast_to(jnp.concatenate([jnp.zeros((s, p)), jnp.eye(s)], 1), (r, s, p + s))
    sensitivity = by.C @ propagate(by.A, forcing, origin)
    error = residual_outputs(vehicle, runs, vehicle.measure(runs.times, states, runs.signals))
    theta, start = sensitivity[..., :p] + by.direct, sensitivity[..., p:]
    return Linearised(states, error, by.A, by.G, by.C, theta, start)


@eqx.filter_jit
def force_columns(
    model: Linearised, start_force: Float[Array, "r k1 n q"], end_force: Float[Array, "r k1 n q"]
) -> Float[Array, "r k c q"]:
    """What q extra generalised forces, given at the start and end of each interval (N, N m), do to the outputs."""
    forcing = model.G @ jnp.concatenate([start_force, end_force], axis=2)
    r, s, q = forcing.shape[0], forcing.shape[2], forcing.shape[3]
    return model.C @ propagate(model.A, forcing, jnp.zeros((r, s, q)))


def _columns(f: Callable[[Array], Array], at: Float[Array, " q"]) -> Array:
    """The Jacobian of `f` at `at`, its columns last: forward mode, all columns in one batch."""
    return jax.vmap(lambda tangent: jax.jvp(f, (at,), (tangent,))[1], out_axes=-1)(jnp.eye(at.size, dtype=at.dtype))
