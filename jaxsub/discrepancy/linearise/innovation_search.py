r"""Maximum likelihood by innovations: free parameters and a disturbance, in alternation.

With the disturbance fixed, a step of the parameters is one of Gauss and Newton on the whitened innovations, damped
where it must be (Levenberg 1944). With the parameters fixed, the disturbance is that of largest restricted
likelihood.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from functools import cached_property

import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from ...arrays import quietly
from ...estimate import Problem, by_cost, estimate_disturbance
from ...likelihood import Columns, Disturbance, FilteredRuns, filter_runs, smoothed
from ...vehicle import AbstractVehicle
from ...vehicle.layout import Layout

# dampings of a scoring step, of a column's squares, and shares of a change of the disturbance, tried in this order
_DAMPINGS, _SHARES = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1), (1.0, 0.5)
# of what a search for the disturbance gained: to gain less is not worth a step before its columns change
_SMALL = 0.01
# alternations at most, and the change of the log likelihood below which they have converged
_ALTERNATIONS, _CONVERGED = 8, 0.5
# scoring steps at most under one disturbance, and the gain of the log likelihood below which they end
_STEPS, _LEAST_GAIN = 30, 2.0
# a gain of log likelihood that no step is worth
_NEGLIGIBLE_GAIN = 0.1
# information about a direction of the coefficients that the recordings do not identify, relative to one column's
_UNIDENTIFIED = 1e-7


@dataclasses.dataclass(frozen=True)
class Iterate:
    """A vehicle and a disturbance, and the innovations of the recordings under them.

    Columns and what is made of them are NumPy arrays: their algebra is small, and worth no program.

    **Fields**

    - `vehicle`, `disturbance`: the free parameters and the Gauss–Markov forces. `followed`: the filter's pass.
    - `base`: the innovations and their sensitivities to the p free parameters, each of the latter of unit length;
      `length`: (p,) what they were divided by; `prior`: (p + 1, p + 1) products of the columns' priors.
    - `gram`: (p + 1, p + 1) products of the whitened columns, priors included. `log_determinant`: half that of the
      innovations' covariance.
    - `damping`: the index of the damping by which a step led here.
    """

    vehicle: AbstractVehicle
    disturbance: Disturbance
    followed: FilteredRuns
    base: Columns
    prior: Float[np.ndarray, "p1 p1"]
    length: Float[np.ndarray, " p"]
    gram: Float[np.ndarray, "p1 p1"]
    log_determinant: float
    damping: int = 0

    @cached_property
    @quietly
    def cost(self) -> float:
        """Minus the log restricted likelihood; NaN where the columns' products are not positive definite."""
        among, across = self.gram[1:, 1:], self.gram[1:, 0]
        sign, logarithm = np.linalg.slogdet(among)
        if not sign > 0.0:
            return np.nan
        left = self.gram[0, 0] - across @ np.linalg.solve(among, across)
        return self.log_determinant + 0.5 * float(logarithm + left)

    @property
    def likelihood_cost(self) -> float:
        """Minus the log likelihood of these very parameters."""
        return 0.5 * float(self.gram[0, 0]) + self.log_determinant


@dataclasses.dataclass(frozen=True)
class InnovationSearch:
    """The search on the recordings of a `problem`.

    The filter begins at initial states of mean `start` (R, s), and follows a path from there by the covariance `begin`
    (R, s, s), by default that of the problem's priors.
    """

    problem: Problem
    start: Array
    begin: Float[np.ndarray, "r s s"] | None = None

    @quietly
    def evaluate(self, vehicle: AbstractVehicle, disturbance: Disturbance) -> Iterate:
        """The innovations of a vehicle under a disturbance, and their sensitivities."""
        problem, names = self.problem, [row.name for row in vehicle.layout.free]
        disturbance = jax.tree.map(np.asarray, disturbance)
        known = self.start, problem.start_std, self.begin
        followed = filter_runs(vehicle, problem.runs, problem.sigma, disturbance, *known)
        found = np.asarray(followed.products)[: 1 + len(names), : 1 + len(names)]
        length = root_or_one(np.diag(found)[1:])
        unit = np.concatenate([np.ones(1), length])
        values = vehicle.values()
        away = np.asarray(problem.prior_mean) - np.array([float(values[name]) for name in names])
        pulled = np.column_stack([away, np.diag(1.0 / length)]) / np.asarray(problem.prior_std)[:, None]
        prior = pulled.T @ pulled + np.diag([0.0, *[_UNIDENTIFIED] * len(names)])
        base = jax.tree.map(lambda a, b: np.concatenate([a, b], axis=-1) / unit, followed.residual, followed.theta)
        gram = found / np.outer(unit, unit) + prior
        return Iterate(vehicle, disturbance, followed, base, prior, length, gram, float(followed.log_determinant))

    @quietly
    def scoring_step(self, iterate: Iterate) -> Iterate:
        """A scoring step of the parameters within their bounds, damped where it must be to gain likelihood.

        The same iterate where no step gains, or the step promises next to nothing. The first damping tried is a little
        less than the last one's.
        """
        rows = iterate.vehicle.layout.free
        here = np.array([float(iterate.vehicle.values()[row.name]) for row in rows])
        low, high = (np.array([(row.lower, row.upper) for row in rows]).reshape(-1, 2).T - here) * iterate.length
        for damping in range(max(iterate.damping - 1, 0), len(_DAMPINGS)):
            step = _step(iterate.gram, _DAMPINGS[damping], low, high)
            if _promised(iterate.gram, step) < _NEGLIGIBLE_GAIN:
                break
            moved = here + step / iterate.length
            named = {row.name: np.asarray(value) for row, value in zip(rows, moved, strict=True)}
            trial = self.evaluate(iterate.vehicle.with_values(named), iterate.disturbance)
            if trial.likelihood_cost < iterate.likelihood_cost:
                return dataclasses.replace(trial, damping=damping)
        return iterate

    @quietly
    def alternated(self, iterate: Iterate) -> Iterate:
        """One alternation: a new disturbance, then a scoring step under it; the same iterate where neither gains.

        Half the change of the disturbance is tried too: it is estimated along the trajectory filtered under the former
        one, and another disturbance filters another.
        """
        for disturbance in _disturbances(iterate):
            after = self.scoring_step(self.evaluate(iterate.vehicle, disturbance))
            if by_cost([iterate, after])[0] is after:
                return after
        return iterate

    def converged(self, iterate: Iterate) -> Iterate:
        """Alternations until the restricted likelihood stays; an iterate without a finite cost stays."""
        for _ in range(_ALTERNATIONS):
            before, iterate = iterate, self.alternated(iterate)
            if not abs(before.cost - iterate.cost) >= _CONVERGED:
                break
        return iterate

    @quietly
    def maximised(self, iterate: Iterate) -> Iterate:
        """Alternations with as many scoring steps as gain under each disturbance, until the likelihood stays."""
        iterate = self._scored(iterate)
        for _ in range(_ALTERNATIONS):
            tried = (self._scored(self.evaluate(iterate.vehicle, one)) for one in _disturbances(iterate))
            gains = lambda after, cost=iterate.likelihood_cost: cost - after.likelihood_cost >= _LEAST_GAIN
            better = next(filter(gains, tried), None)
            if better is None:
                break
            iterate = better
        return iterate

    def from_smoothed(self, iterate: Iterate, ended: Callable[["InnovationSearch", Iterate], Iterate]) -> Iterate:
        """Where the search `ended` along the path from where all samples say that the runs began, as sure as they say.

        From its prior alone a velocity that nothing measures is led far off by the first samples' noise. The iterate
        itself where the filter diverges from there.
        """
        search = self._begun(iterate)
        found = ended(search, search.evaluate(iterate.vehicle, iterate.disturbance))
        return found if np.isfinite(found.cost) else iterate

    @quietly
    def _begun(self, iterate: Iterate) -> "InnovationSearch":
        """The search from where all samples say that the runs began."""
        problem = self.problem
        found = smoothed(iterate.disturbance, iterate.followed.system, left_over(iterate.base, iterate.gram))
        fitted, prior = fitted_states(problem.vehicle.layout), np.diag(np.asarray(problem.start_std) ** 2)
        start = np.asarray(self.start) + np.where(fitted, np.asarray(found.start), 0.0)
        begin = np.where(np.outer(fitted, fitted), np.asarray(found.covariance), prior)
        return dataclasses.replace(self, start=jax.device_put(start), begin=begin)

    def _scored(self, iterate: Iterate) -> Iterate:
        """Scoring steps until they gain little."""
        for _ in range(_STEPS):
            before, iterate = iterate, self.scoring_step(iterate)
            if not before.likelihood_cost - iterate.likelihood_cost >= _LEAST_GAIN:
                break
        return iterate


def left_over(base: Columns, gram: Float[np.ndarray, "p1 p1"]) -> Columns:
    """The innovations less their projection on the free parameters, the columns of `base`, by the products of all."""
    weights = np.append(1.0, -np.linalg.solve(gram[1:, 1:], gram[1:, 0]))
    return jax.tree.map(lambda column: (column @ weights)[..., None], base)


def fitted_states(layout: Layout) -> Bool[np.ndarray, " s"]:
    """Which initial states are known by a fit: not runs' deviations, whose predictions a filter is to show."""
    return np.array([name not in layout.deviations for name in layout.states])


def _disturbances(iterate: Iterate) -> Iterator[Disturbance]:
    """The disturbance of largest restricted likelihood for the iterate's parameters, and one half as far."""
    system = iterate.followed.system
    found = estimate_disturbance(system, iterate.base, iterate.prior, iterate.disturbance, share=_SMALL)
    for share in _SHARES:
        towards = lambda old, new, share=share: old * (np.asarray(new) / old) ** share
        yield jax.tree.map(towards, iterate.disturbance, found)


def _step(gram: np.ndarray, damped: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step of least squares between bounds, of the products (p + 1, p + 1) of a residual and its columns.

    A free step that is cut off at a bound would be wrong in every parameter correlated with the bounded one.
    """
    squares = gram[1:, 1:] + damped * np.eye(len(low))
    step = np.linalg.solve(squares, gram[1:, 0])
    if not np.any((step < low) | (step > high)):
        return step
    factor = np.linalg.cholesky(squares)
    from scipy.optimize import lsq_linear

    return lsq_linear(factor.T, np.linalg.solve(factor, gram[1:, 0]), (low, high), method="bvls").x


def _promised(gram: np.ndarray, step: np.ndarray) -> float:
    """What a step would gain of the log likelihood if it were linear in the numbers."""
    return float(step @ (gram[1:, 0] - 0.5 * gram[1:, 1:] @ step))


def root_or_one(squares: Float[np.ndarray, " q"]) -> Float[np.ndarray, " q"]:
    """Lengths of columns by their squares; one for an empty column."""
    return np.where(squares > 0.0, np.sqrt(np.maximum(squares, 0.0)), 1.0)


def distinct(found: Iterable[Iterate]) -> list[Iterate]:
    """By cost, one of those that converge to the same optimum."""
    kept: list[Iterate] = []
    for iterate in by_cost(found):
        if not kept or not abs(iterate.cost - kept[-1].cost) < _CONVERGED:
            kept.append(iterate)
    return kept
