"""Gauss–Newton over runs that are too long for the memory: every expansion is summed over blocks of samples."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..likelihood import block_length
from ..results import RESULTS
from .damped import Damped, State
from .method import Found, Iterative, Passes, from_start
from .pool import ending
from .problem import Problem

# passes that a search takes as a rule, and by how much each brings it nearer at least, before it has shown itself
_USUAL, _SLOWEST = 6, 0.7


class GaussNewton(Iterative):
    """Damped Gauss–Newton; one search over runs of many blocks goes block by block, and tells how far it is.

    Many searches, or runs of one block, go through a pool as those of any method.
    """

    solver: Damped

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """As `Iterative.run`. `passes` is told of passes over all samples: how many are done and how many expected."""
        runs = problem.runs
        if len(starts) > 1 or outputs is not None or block_length(problem.vehicle, runs) >= runs.times.shape[1] - 1:
            return super().run(problem, starts, outputs)
        y, state, tell = starts[0], None, passes or (lambda done, expected: None)
        decrements: list[float] = []
        while True:
            taken = len(decrements)
            expected = taken + _passes_left(decrements, self.solver.tolerance)
            share = lambda part, taken=taken, expected=expected: tell(taken + part, expected)
            gram = problem.products_in_blocks(y if state is None else state.trial, share)
            y, state, done, result = _step(self.solver, problem, y, state, gram)
            decrements.append(float(state.decrement))
            if bool(done) or len(decrements) >= self.max_steps:
                break
        steps = jnp.asarray(len(decrements))
        return jax.tree.map(lambda leaf: leaf[None], Found(y, state.at.cost, steps, from_start(result, steps)))


@eqx.filter_jit
def _step(
    solver: Damped, problem: Problem, y: Array, state: State | None, gram: Float[Array, "r q q"]
) -> tuple[Array, State, Bool[Array, ""], RESULTS]:
    """A step of `solver` by the products at the trial, and whether and how the search ends there."""
    new = problem.expansion(y if state is None else state.trial, gram)
    y, state = solver.follow(y, problem, solver.begin(y, new) if state is None else state, new)
    done, result = solver.terminate(None, y, problem, {}, state, frozenset())
    result, done = ending(y, done, RESULTS.promote(result))
    return y, state, done, result


def _passes_left(decrements: list[float], tolerance: float) -> int:
    """Passes that a search will still take, if each brings it as much nearer as the last one did."""
    *_, before, now = math.nan, math.nan, *decrements
    if not (math.isfinite(before) and math.isfinite(now)):
        return max(1, _USUAL - len(decrements))
    rate = min(max(now / before, 1e-9), _SLOWEST)
    return max(1, math.ceil(math.log(max(now, 1e-300) / tolerance) / -math.log(rate)))
