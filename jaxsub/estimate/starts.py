"""Monte-Carlo over initial guesses: where starts are, how often a method succeeds, and into which basins they fall."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PRNGKeyArray

from ..programs import compiled
from .method import Found
from .problem import Problem

# standard errors between ends of one basin
_REACH = 1.0
# of ends whose distances are all taken
_PAIRS = 20_000_000


def scattered(problem: Problem, spread: float, count: int, seed: int) -> Float[Array, "n d"]:
    """Coordinates of `count` starts, each parameter drawn uniformly within ± `spread` of the size it has in `problem`.

    A `spread` of 1 draws from zero to twice each value, by `seed`. Initial states start at their guess.
    """
    draws = np.random.default_rng(seed).uniform(-spread, spread, (count, len(problem.origin)))
    return _moved(problem, jnp.asarray(draws))


def scattered_by_number(
    problem: Problem, spread: float, numbers: Int[Array, " n"], key: PRNGKeyArray
) -> Float[Array, "n d"]:
    """Such starts again, each drawn by `key` and its own number alone: a part of them is drawn as all of them are."""

    def draw(number: Array) -> Array:
        shape = problem.origin.shape
        return jax.random.uniform(jax.random.fold_in(key, number), shape, minval=-spread, maxval=spread)

    return _moved(problem, jax.vmap(draw)(numbers))


def _moved(problem: Problem, draws: Float[Array, "n p"]) -> Float[Array, "n d"]:
    centre = problem.transform.to_physical(problem.origin)
    return jax.vmap(problem.at)(centre * (1.0 + draws))


@dataclasses.dataclass(frozen=True)
class Rate:
    """A share of `count` trials with its 95 % interval by Wilson."""

    successes: int
    count: int

    @property
    def share(self) -> float:
        """Successes over trials."""
        return self.successes / self.count

    @property
    def interval(self) -> tuple[float, float]:
        """Lower and upper end."""
        from scipy import stats

        ends = stats.binomtest(self.successes, self.count).proportion_ci(method="wilson")
        return float(ends.low), float(ends.high)

    def to_json(self) -> dict:
        """Plain numbers."""
        return {"share": self.share, "interval": list(self.interval), "successes": self.successes, "count": self.count}


MARGIN = 0.1  # in cost: under half a standard error away


def success(found: Found, best: float, margin: float = MARGIN) -> Rate:
    """How many of the searches `found` came within `margin` of the least cost known, `best`.

    One that failed, or whose cost is not a number, is no success and is counted.
    """
    cost = np.asarray(found.cost)
    return Rate(int(np.sum(cost < best + margin)), len(cost))


@dataclasses.dataclass(frozen=True)
class Basin:
    """Ends of searches that lie together.

    **Fields**

    - `cost`: the least among them, ½ Σ whitened residuals². `count`: how many there are.
    - `y`: (d,) coordinates of the best.
    """

    cost: float
    count: int
    y: np.ndarray


def basins(problem: Problem, found: Found) -> tuple[list[Basin], int]:
    """The ends `found` on `problem`, clustered, the lowest first, and how many searches have no finite end.

    Ends belong together where one can go from each to the next in steps shorter than a standard error, as the
    curvature at the best end has them.
    """
    cost, y = np.asarray(found.cost), np.asarray(found.y)
    finite = np.flatnonzero(np.isfinite(cost) & np.isfinite(y).all(1))
    lost = len(cost) - len(finite)
    if not len(finite):
        return [], lost
    order = finite[np.argsort(cost[finite])]
    curvature = np.asarray(_curvature(problem, jnp.asarray(y[order[0]])))
    values, vectors = np.linalg.eigh(curvature)
    whitened = (y[order] - y[order[0]]) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
    label = _connected(whitened)
    found_in = {basin: np.flatnonzero(label == basin) for basin in dict.fromkeys(label.tolist())}
    return [Basin(float(cost[order[i[0]]]), len(i), y[order[i[0]]]) for i in found_in.values()], lost


def _connected(points: Float[np.ndarray, "n d"]) -> Int[np.ndarray, " n"]:
    """A number for each point, the same where one can go from one to the other in steps of at most `_REACH`.

    Where more than `_PAIRS` are that close, those that share a cell of a grid count as one point, a hundredth of
    `_REACH` wide and as much wider as it takes.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    tree, member, width = KDTree(points), np.arange(len(points)), 0.0
    while tree.count_neighbors(tree, _REACH) > _PAIRS:
        width = 2.0 * width or 0.01 * _REACH / np.sqrt(points.shape[1])
        _, first, member = np.unique(np.floor(points / width), axis=0, return_index=True, return_inverse=True)
        tree = KDTree(points[first])
    pairs = tree.query_pairs(_REACH, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(tree.n, tree.n))
    return connected_components(graph, directed=False)[1][member]


@compiled
def _curvature(problem: Problem, y: Float[Array, " d"]) -> Float[Array, "d d"]:
    return problem.expand(y).hessian
