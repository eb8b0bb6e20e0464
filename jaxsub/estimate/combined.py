"""Methods made of methods: one after the other, and a global search that a local one completes."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..programs import compiled
from .method import AbstractMethod, Found, Passes, costs, lanes_for, problems
from .problem import Problem

# larger than any cost and still a number to an algorithm that compares
_HOPELESS = 1e300
# members of the population for each coordinate, and what its draws come from
_MEMBERS, _SEED = 4, 0


class Chain(AbstractMethod):
    """`first`, then `second` from where it ended; from the start itself where it ended nowhere."""

    first: AbstractMethod
    second: AbstractMethod

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """Both, their evaluations added."""
        before = self.first.run(problem, starts, outputs, passes)
        usable = jnp.isfinite(before.cost)[:, None] & jnp.all(jnp.isfinite(before.y), axis=1, keepdims=True)
        after = self.second.run(problem, jnp.where(usable, before.y, starts), outputs, passes)
        return eqx.tree_at(lambda found: found.evaluations, after, before.evaluations + after.evaluations)


class Global(AbstractMethod):
    """Differential evolution in a box about the problem's origin, then a local method from the best member.

    The paper uses a genetic algorithm; this is its descendant for real numbers. Where the search starts plays no
    part, except that it is one member of the population. Not to be called inside `jit`.

    **Fields**

    - `local`: what completes the search.
    - `span`: half the side of the box, in each parameter's own size; bounds, where a parameter has them, hold besides.
    - `generations`: of the evolution.

    Source: Storn and Price (1997), J. Global Optimization 11.
    """

    local: AbstractMethod
    span: float = 1.5
    generations: int = 300

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """One evolution for each start that is a number."""
        of, ends, counts = problems(problem, outputs), [], []
        for index, start in enumerate(np.asarray(starts)):
            finite = np.isfinite(start).all()
            best, count = self._evolve(of(jnp.asarray(index)), start) if finite else (start, 0)
            ends.append(best)
            counts.append(count)
        found = self.local.run(problem, jnp.asarray(np.stack(ends)), outputs, passes)
        return eqx.tree_at(lambda found: found.evaluations, found, found.evaluations + jnp.asarray(counts))

    def _evolve(self, problem: Problem, start: np.ndarray) -> tuple[np.ndarray, int]:
        from scipy.optimize import differential_evolution

        centre, sampled = np.asarray(problem.coordinates()), 0
        box = np.stack([centre - self.span, centre + self.span], axis=1)

        def cost(members: np.ndarray) -> np.ndarray:
            nonlocal sampled
            sampled += members.shape[1]
            value = np.asarray(_population_costs(problem, jnp.asarray(members.T)))
            return np.where(np.isfinite(value), value, _HOPELESS)

        evolved = differential_evolution(
            cost,
            box,
            maxiter=self.generations,
            popsize=_MEMBERS,
            init="sobol",
            x0=np.clip(start, box[:, 0], box[:, 1]),
            mutation=(0.4, 0.9),
            recombination=0.9,
            polish=False,
            vectorized=True,
            updating="deferred",
            rng=np.random.default_rng(_SEED),
        )
        return evolved.x, sampled


@compiled
def _population_costs(problem: Problem, members: Float[Array, "n d"]) -> Float[Array, " n"]:
    return costs(lambda _: problem, members, lanes_for(problem))
