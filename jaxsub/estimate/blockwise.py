"""Gauss–Newton by expansions that are summed over blocks of samples, since long runs are too long for the memory."""

import itertools
import math
from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from ..arrays import Values
from ..programs import compiled
from ..results import RESULTS
from .coordinates import Coordinates
from .damped import Damped, State
from .method import Found, Iterative, Passes, by_cost, from_start, unwatched
from .pool import ending
from .problem import Problem

# passes that several searches take before the worse half is given up
_ROUND = 12
# passes that a search takes as a rule, and by how much each brings it nearer at least, before it has shown itself
_USUAL, _SLOWEST = 6, 0.7


class Descent:
    """One damped Gauss–Newton search, a pass over all samples at a time."""

    def __init__(self, method: "GaussNewton", problem: Problem, start: Float[Values, " d"]):
        self._solver, self._method, self.problem = method.solver, method, problem
        self._space = problem.without_vehicle
        self._y = self._trial = jax.device_put(np.asarray(start))
        self._state: State | None = None
        self._decrements: list[float] = []
        self._costs: list[float] = []
        self._result: RESULTS | None = None
        self.done = False

    @property
    def cost(self) -> float:
        """The least so far."""
        return np.inf if self._state is None else float(self._state.at.cost)

    @property
    def passes(self) -> int:
        """How many were made."""
        return len(self._decrements)

    def advance(self, tell: Passes) -> None:
        """One pass more; `tell` as by `AbstractMethod.run`."""
        expected = float(self.passes + _passes_left(self._decrements, self._solver.tolerance))
        share = lambda part: tell(self.passes + part, expected)
        gram = self.problem.products_in_blocks(self._trial, share)
        if self._state is None:
            self._state = self._solver.begin(self._y, eqx.filter_eval_shape(self._space.expansion, self._y, gram))
        self._y, self._state, done, self._result = _step(self._solver, self._space, self._y, self._state, gram)
        self._decrements.append(float(self._state.decrement))
        self._costs.append(self.cost)
        crawls = self.passes > _ROUND and self._costs[-1 - _ROUND] - self.cost < self._method.least
        self._trial, self.done = self._state.trial, bool(done) or crawls or self.passes >= self._method.max_steps

    @property
    def found(self) -> Found:
        """Where it is, as the only one of several searches."""
        assert self._state is not None and self._result is not None
        return _ended(self._y, self._state.at.cost, jax.device_put(np.asarray(self.passes)), self._result)


class GaussNewton(Iterative):
    """Damped Gauss–Newton; one search goes block by block, and tells how far it is.

    It takes the programs that a fit's statistics need anyway. Many searches, and those of compiled C, go through a pool
    as those of any method. One that goes block by block also ends, as after `max_steps`, where its last twelve passes
    have lowered the cost by less than `least`.
    """

    solver: Damped
    least: float = eqx.field(static=True, default=0.0)

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """As `Iterative.run`. `passes` is called with the passes over all samples done, and those expected."""
        if len(starts) > 1 or outputs is not None or problem.march is not None:
            return super().run(problem, starts, outputs)
        return raced([Descent(self, problem, np.asarray(starts)[0])], passes or unwatched).found


def raced(searches: Sequence[Descent], tell: Passes = unwatched) -> Descent:
    """Some searches, none begun yet: the one that is best at its end.

    All take some passes and the better half goes on, until one is left.
    """
    for limit in itertools.count(_ROUND, _ROUND):
        for search in searches:
            while not search.done and (search.passes < limit or len(searches) == 1):
                search.advance(tell)
        if len(searches) == 1:
            break
        searches = by_cost(searches)[: len(searches) // 2]
    return searches[0]


@compiled
def _step(
    solver: Damped, space: Coordinates, y: Array, state: State, gram: Float[Array, "r q q"]
) -> tuple[Array, State, Bool[Array, ""], RESULTS]:
    """A step of `solver` by the products at the trial, and whether and how the search ends there."""
    y, state = solver.follow(y, space, state, space.expansion(state.trial, gram))
    done, result = solver.terminate(None, y, space, {}, state, frozenset())
    result, done = ending(y, done, RESULTS.promote(result))
    return y, state, done, result


@compiled
def _ended(y: Array, cost: Array, steps: Array, result: RESULTS) -> Found:
    """One search, as the only one of several."""
    return jax.tree.map(lambda leaf: leaf[None], Found(y, cost, steps, from_start(result, steps)))


def _passes_left(decrements: list[float], tolerance: float) -> int:
    """Passes that a search will still take, if each brings it as much nearer as the last one did."""
    *_, before, now = math.nan, math.nan, *decrements
    if not (math.isfinite(before) and math.isfinite(now)):
        return max(1, _USUAL - len(decrements))
    rate = min(max(now / before, 1e-9), _SLOWEST)
    return max(1, math.ceil(math.log(max(now, 1e-300) / tolerance) / -math.log(rate)))
