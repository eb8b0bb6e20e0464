r"""Profile likelihoods: the cost along one coefficient, all others and the initial states re-optimised at every value.

$2\,[J(\theta_i) - J(\hat\theta)]$ is $\chi^2_1$ at the true value, so the interval of 95 % is where it stays below
3.84. Unlike a standard error it need not be symmetric, and where the likelihood does not rise it has no end.
"""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..errors import InputError, nearest
from ..estimate import Problem, Solution, gauss_newton
from ..estimate.method import costs, holding, lanes_for, objective
from ..estimate.pool import pool
from ..programs import compiled
from ..results import RESULTS

_CHI2 = 3.841458820694124


@dataclasses.dataclass(frozen=True)
class Profile:
    """The likelihood along one coefficient.

    **Fields**

    - `values`: (g,) physical. `rise`: (g,) twice the rise of minus the log-likelihood, NaN where the search failed.
    - `interval`: of 95 %, physical; infinite on a side where the likelihood does not fall far enough on the grid.
    """

    name: str
    values: np.ndarray
    rise: np.ndarray
    interval: tuple[float, float]


def profile(fit: Solution, names: Sequence[str], *, points: int = 13, width: float = 3.0) -> list[Profile]:
    """Profiles of the coefficients `names` at `points` values within `width` standard errors of the fit.

    Where a standard error exceeds the coefficient's own size, the grid goes by that size. All points of all profiles
    share one compiled search.

    **Raises** `InputError` for a name that is not a free coefficient.
    """
    for name in names:
        if name not in fit.names:
            close = nearest(name, fit.names)
            raise InputError(name, "is no free coefficient", f"say {close}" if close else "name one that is")
    if not names:
        return []
    problem, theta = fit.problem, np.array(list(fit.values.values()))
    covariance = np.asarray(fit.covariance)
    which = np.repeat([fit.names.index(name) for name in names], points)
    error = np.sqrt(np.diag(covariance))
    reach = np.where(theta == 0.0, error, np.minimum(error, np.abs(theta)))
    moved = np.tile(np.linspace(-width, width, points), len(names)) * reach[which]
    # the others follow along the ridge, as far as the likelihood is a parabola
    starts = theta + moved[:, None] * covariance[which] / covariance[which, which][:, None]
    starts[np.arange(len(which)), which] = theta[which] + moved
    # the last search moves all: the optimum that the others are measured against
    y = _coordinates(fit, problem, np.concatenate([starts, theta[None]]))
    moving = jnp.asarray(np.arange(len(theta)) != np.append(which, -1)[:, None])
    *cost, least = np.asarray(_costs(problem, y, moving))
    # inside its bounds, where the grid would leave them
    physical = np.asarray(jax.vmap(problem.transform.to_physical)(y[:-1, : len(theta)]))
    values = physical[np.arange(len(which)), which].reshape(len(names), points)
    rise = 2.0 * (np.reshape(cost, values.shape) - least)
    return [Profile(n, v, r, _interval(v, r, fit.values[n])) for n, v, r in zip(names, values, rise, strict=True)]


def _coordinates(fit: Solution, problem: Problem, theta: np.ndarray) -> Float[Array, "g d"]:
    """Coordinates of the coefficients `theta` (g, p) and the fitted initial states."""
    # initial states that are known have no spread, and no coordinates
    moved = (fit.start - problem.guess) / jnp.where(problem.start_std > 0.0, problem.start_std, 1.0)
    states = problem.coordinates()[theta.shape[1] :]
    rows = jax.vmap(problem.at)(jnp.asarray(theta))
    return rows.at[:, theta.shape[1] :].set(moved.ravel()[: states.size])


@compiled
def _costs(problem: Problem, starts: Float[Array, "g d"], moving: Bool[Array, "g p"]) -> Float[Array, " g"]:
    """The least cost from each start with only the coefficients `moving` free; NaN where the search failed."""
    p, held = moving.shape[1], holding(lambda _: problem, starts, moving)
    method, lanes = gauss_newton(), lanes_for(problem)
    ends = pool(method.solver, objective, starts, held, lanes=lanes, max_steps=method.max_steps)
    # the prior of a coefficient that is held counts at its held value
    y = jnp.concatenate([jnp.where(moving, ends.y[:, :p], starts[:, :p]), ends.y[:, p:]], axis=1)
    return jnp.where(ends.result == RESULTS.successful, costs(held, y, lanes), jnp.nan)


def _interval(values: np.ndarray, rise: np.ndarray, best: float) -> tuple[float, float]:
    """Where the signed root of the rise, nearly straight, crosses that of 3.84 on either side."""
    root = np.sqrt(np.maximum(rise, 0.0))

    def crossing(side: np.ndarray, end: float) -> float:
        away, height = np.append(0.0, np.abs(values[side] - best)), np.append(0.0, root[side])
        order = np.argsort(away)
        away, height = away[order], height[order]
        beyond = np.flatnonzero(height >= np.sqrt(_CHI2))
        if not len(beyond):
            return end
        i = int(beyond[0])
        part = (np.sqrt(_CHI2) - height[i - 1]) / (height[i] - height[i - 1])
        return best + np.sign(end) * (away[i - 1] + part * (away[i] - away[i - 1]))

    usable = np.isfinite(rise)
    return crossing(usable & (values < best), -np.inf), crossing(usable & (values > best), np.inf)
