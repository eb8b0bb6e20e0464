r"""The model linearised along its trajectory, and the one recursion through which every question is asked.

A coefficient, an initial state, a candidate effect and an unknown force differ only in how they force
$D_{k+1} = A_k D_k + f_k$, so all of them go through it as columns of one batch. The Jacobians are exact derivatives of
the sampled step; nothing here depends on how many effects the vocabulary has.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import Sampled, Slopes, linearised_step, sampled_states
from ..vehicle import AbstractVehicle
from .output_error import first_turns, wrapped_errors

# samples whose steps are differentiated at once: few enough to stay in a core's cache, which takes a third of the time
# that thousands take
_SIDE_BY_SIDE = 16


class Linearised(eqx.Module):
    """A model along its trajectory through R runs of K samples, s states, c channels, n equations, p free parameters.

    **Fields**

    - `states`: (R, K, s) SI. `error`: (R, K, c) measured minus modelled, SI, zero where missing.
    - `A`: (R, K-1, s, s) of the step by the state, SI. `G`: (R, K-1, s, 2n) by a force at its start and end, SI.
    - `C`: (R, K, c, s) of the outputs by the state, SI.
    - `theta`: (R, K, c, p) of the outputs by the free parameters, in their coordinates; `start`: (R, K, c, s) by the
      run's initial state, SI.
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

    - `A`: (R, K-1, s, s) SI, `G`: (R, K-1, s, 2n) SI and `C`: (R, K, c, s) SI, as of `Linearised`.
    - `F`: (R, K-1, s, p) of the step by the free parameters, in their coordinates.
    - `direct`: (R, K, c, p) of the outputs by the free parameters, in their coordinates, the state held.
    - `shown`: (R, K, c) the outputs themselves, SI.
    """

    A: Float[Array, "r k1 s s"]
    G: Float[Array, "r k1 s n2"]
    C: Float[Array, "r k c s"]
    F: Float[Array, "r k1 s p"]
    direct: Float[Array, "r k c p"]
    shown: Float[Array, "r k c"]


# one program of it for whatever linearises a model: derivatives are most of what a model's programs take to compile
@compiled
def jacobians(
    vehicle: AbstractVehicle,
    runs: Runs,
    before: Float[Array, "r k s"],
    at: Float[Array, "r k s"],
    push: Float[Array, "r k1 2 n"],
) -> Jacobians:
    """Jacobians of the steps of `vehicle` from the states `before`, but the last, and of its outputs at states `at`.

    Both are (R, K, s), SI, at the samples of `runs`. `push` (R, K-1, 2, n), N or N m, are forces at the start and end
    of each interval, linear between.
    """
    names = [row.name for row in vehicle.layout.free]
    values = vehicle.values()
    theta = jnp.stack([values[name] for name in names]) if names else jnp.zeros(0)
    with_theta = lambda vector: vehicle.with_values(dict(zip(names, vector, strict=True)))
    before = before[:, :-1]
    r, k1, s = before.shape
    p = len(names)
    live = runs.live.reshape(-1)[:, None, None]

    def ready(parameters: Array) -> tuple[Sampled, Array]:
        model = Sampled.of(with_theta(parameters), runs)
        return model, jax.vmap(model.vehicle.actuate)(runs.times, runs.nodes())

    # the weights of a step have derivatives by the parameters alone, which all samples share
    of = lambda tangent: jax.jvp(ready, (theta,), (tangent,))
    (model, nodes), (by_model, by_nodes) = jax.vmap(of, out_axes=(None, 0))(jnp.eye(p))

    def stepped(sample: tuple[Array, ...]) -> Float[Array, "s q"]:
        state, node, by_node, index, push = sample
        # the weights of one length alone are the same for all samples, whose products with them are then one
        index = index if len(runs.steps) > 1 else jnp.asarray(0)
        step = linearised_step(model, state, node, index, push, Slopes(by_model, by_node))
        # side by side, since where nothing is free an array of no columns would have no batches
        return jnp.concatenate([step.A, step.G, step.F], axis=-1)

    flat = lambda array: array.reshape(r * k1, *array.shape[2:])
    by_nodes = jnp.moveaxis(by_nodes, 0, 2)
    samples = tuple(map(flat, (before, nodes, by_nodes, runs.step_of, push)))
    # a remainder would be compiled apart, in as much time again
    whole = -(-r * k1 // _SIDE_BY_SIDE) * _SIDE_BY_SIDE
    samples = jax.tree.map(lambda a: jnp.pad(a, [(0, whole - r * k1), *[(0, 0)] * (a.ndim - 1)], mode="edge"), samples)
    columns = jax.lax.map(stepped, samples, batch_size=_SIDE_BY_SIDE)[: r * k1]

    def shown(change: Array) -> Array:
        parameters, moved = jnp.split(change, [p])
        return with_theta(theta + parameters).measure(runs.times, at + moved, runs.signals)

    A, G, F = jnp.split(columns, [s, s + push.shape[-1] * 2], axis=-1)
    A = jnp.where(live, A, jnp.eye(s)).reshape(r, k1, s, s)
    G, F = (jnp.where(live, M, 0.0).reshape(r, k1, s, M.shape[-1]) for M in (G, F))
    outputs, by_change = value_and_columns(shown, jnp.zeros(p + s))
    direct, C = jnp.split(by_change, [p], axis=-1)
    return Jacobians(A, G, C, F, direct, outputs)


class Checkpoint(eqx.Module):
    """What a linearised model is at one sample of R runs, from which it goes on to the samples that follow.

    **Fields**

    - `state`: (R, s). `by`: (R, s, p+s) the state by the free parameters and by the run's initial state.
    - `turns`: (R, c) whole turns of the angles' first measured samples (`first_turns`).
    """

    state: Float[Array, "r s"]
    by: Float[Array, "r s ps"]
    turns: Float[Array, "r c"]

    @classmethod
    def at_start(cls, vehicle: AbstractVehicle, start: Float[Array, "r s"]) -> "Checkpoint":
        """At the first sample, with the initial states `start`."""
        (r, s), p = start.shape, len(vehicle.layout.free)
        # by NumPy, for which no program has to be made
        own = np.broadcast_to(np.eye(s, p + s, p, start.dtype), (r, s, p + s))
        turns = np.full((r, len(vehicle.layout.channels)), np.nan, start.dtype)
        return cls(start, *jax.device_put((own, turns)))


def linearise_runs(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Linearised:
    """`vehicle` linearised along its trajectory over `runs` from the initial states `start` (R, s), SI."""
    at = Checkpoint.at_start(vehicle, start)
    return along(vehicle.turning, runs, at, *with_jacobians(vehicle, runs, at))[0]


def with_jacobians(vehicle: AbstractVehicle, runs: Runs, at: Checkpoint) -> tuple[Float[Array, "r k s"], Jacobians]:
    """The states from a checkpoint at the first sample of `runs`, and the Jacobians there."""
    states = sampled_states(vehicle, runs, at.state)
    # by NumPy, for which no program has to be made
    unforced = jax.device_put(np.zeros((*runs.live.shape, 2, len(vehicle.layout.equations))))
    return states, jacobians(vehicle, runs, states, states, unforced)


@compiled
def along(
    turning: tuple[bool, ...], runs: Runs, at: Checkpoint, states: Array, by: Jacobians
) -> tuple[Linearised, Checkpoint]:
    """A model along its `states`, `by` the Jacobians there, from a checkpoint at the first; and that at the last."""
    s, p = by.F.shape[-2:]
    forcing = jnp.concatenate([by.F, jnp.zeros((*by.F.shape[:2], s, s))], axis=-1)
    moved = propagate(by.A, forcing, at.by)
    sensitivity = by.C @ moved
    error = wrapped_errors(turning, runs, by.shown, at.turns)
    theta, start = sensitivity[..., :p] + by.direct, sensitivity[..., p:]
    after = Checkpoint(states[:, -1], moved[:, -1], first_turns(runs, by.shown, at.turns))
    return Linearised(states, error, by.A, by.G, by.C, theta, start), after


@compiled
def force_columns(
    model: Linearised, start_force: Float[Array, "r k1 n q"], end_force: Float[Array, "r k1 n q"]
) -> Float[Array, "r k c q"]:
    """What q extra generalised forces do to the outputs of the linearised `model`, (R, K, c, q), SI by N or N m.

    `start_force` and `end_force` (R, K-1, n, q) are the forces at the start and end of each interval, N or N m.
    """
    forcing = model.G @ jnp.concatenate([start_force, end_force], axis=2)
    r, s, q = forcing.shape[0], forcing.shape[2], forcing.shape[3]
    return model.C @ propagate(model.A, forcing, jnp.zeros((r, s, q)))


def value_and_columns(f: Callable[[Array], Array], at: Float[Array, " q"]) -> tuple[Array, Array]:
    """`f` at `at` and its Jacobian, columns last: forward mode, all columns in one batch."""
    along = lambda tangent: jax.jvp(f, (at,), (tangent,))
    return jax.vmap(along, out_axes=(None, -1))(jnp.eye(at.size, dtype=at.dtype))
