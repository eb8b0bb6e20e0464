"""One loop that drives every search: many starts through a few lanes, a finished lane taking the next start at once.

Searches need very different numbers of steps. A plain `vmap` runs all lanes until the slowest is done; here none waits.
"""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int, PyTree

from ..results import NONFINITE, RESULTS, SUCCESSFUL, UNFINISHED


class _Lane(eqx.Module):
    """One search under way: the number of its start, its point, its solver's state and the steps it has taken."""

    index: Int[Array, ""]
    y: Array
    state: PyTree
    steps: Int[Array, ""]


class Ends(eqx.Module):
    """Where N searches ended: points (N, d), steps (N,), and a `RESULTS` value each."""

    y: Float[Array, "n d"]
    steps: Int[Array, " n"]
    result: RESULTS


def ending(y: Float[Array, " d"], done: Bool[Array, ""], result: RESULTS) -> tuple[RESULTS, Bool[Array, ""]]:
    """How a search ends that its solver calls `done`, with that `result`, at `y`; and whether it does, steps apart."""
    result = RESULTS.where(jnp.all(jnp.isfinite(y)), result, NONFINITE)
    done = done | (result != SUCCESSFUL)
    return RESULTS.where(done, result, UNFINISHED), done


def pool(
    solver: optx.AbstractMinimiser,
    fn: Callable[[Array, Any], Float[Array, ""]],
    starts: Float[Array, "n d"],
    args: Callable[[Int[Array, ""]], Any],
    *,
    lanes: int,
    max_steps: int,
) -> Ends:
    """Minimise `fn(y, args(i))` from each of the `starts`, `lanes` at a time; i is the number of the start.

    `solver` is anything of optimistix's `AbstractMinimiser`. A search that does not end is a value in `Ends.result`.
    """
    count, width = len(starts), min(lanes, len(starts))
    with_aux = lambda y, args: (fn(y, args), None)
    scalar = jax.ShapeDtypeStruct((), starts.dtype)
    enter = lambda index, y: _Lane(
        index, y, solver.init(with_aux, y, args(index), {}, scalar, None, frozenset()), jnp.asarray(0)
    )
    lane = jax.vmap(enter)(jnp.arange(width), starts[:width])
    dynamic, static = eqx.partition(lane, eqx.is_array)

    def advance(lane: _Lane) -> tuple[_Lane, Array, RESULTS]:
        own = args(lane.index)
        y, state, _ = solver.step(with_aux, lane.y, own, {}, lane.state, frozenset())
        done, result = solver.terminate(with_aux, y, own, {}, state, frozenset())
        steps = lane.steps + 1
        result, done = ending(y, done, RESULTS.promote(result))
        return _Lane(lane.index, y, state, steps), done | (steps >= max_steps), result

    def body(carry: tuple[Any, Int[Array, ""], Ends]) -> tuple[Any, Int[Array, ""], Ends]:
        dynamic, following, ends = carry
        lane, done, result = jax.vmap(advance)(eqx.combine(dynamic, static))
        # a lane that is not done, or has no start left, writes beyond the end, which is dropped
        at = jnp.where(done, lane.index, count)
        write = lambda held, new: held.at[at].set(new, mode="drop")
        ends = jax.tree.map(write, ends, Ends(lane.y, lane.steps, result))
        index = jnp.where(done, following + jnp.cumsum(done) - 1, lane.index)
        fresh = jax.vmap(enter)(index, starts[jnp.minimum(index, count - 1)])
        swap = lambda new, old: (
            jnp.where(done.reshape(-1, *[1] * (old.ndim - 1)), new, old) if eqx.is_array(old) else old
        )
        lane = jax.tree.map(swap, fresh, lane)
        return eqx.filter(lane, eqx.is_array), following + jnp.sum(done), ends

    def unfinished(carry: tuple[Any, Int[Array, ""], Ends]) -> Array:
        return jnp.any(carry[0].index < count)

    nothing = jnp.zeros(count, jnp.asarray(0).dtype)
    blank = Ends(jnp.zeros_like(starts), nothing, jax.vmap(lambda _: SUCCESSFUL)(nothing))
    return jax.lax.while_loop(unfinished, body, (dynamic, jnp.asarray(width), blank))[2]
