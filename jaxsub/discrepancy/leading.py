"""Free numbers and a disturbance, sought together, under which recordings are most probable sample by sample."""

import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TypeVar

import jax
import numpy as np
from jaxtyping import Array, Float

from ..arrays import quietly
from ..estimate import Ended, Problem, estimate_disturbance
from ..likelihood import Columns, Disturbance, Followed, follow
from ..vehicle import AbstractVehicle
from .settings import PRIOR_WIDTH

# what dampens a scoring step, of a column's squares, and shares of a change of the disturbance, one after the other
_DAMPED, _SHARES = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1), (1.0, 0.5)
# disturbance and numbers are sought in turns until the log likelihood changes by less, or gains less
_TURNS, _STAYS = 8, 0.5
_STEPS, _GAINED = 30, 2.0
# a gain of log likelihood that no step is worth
_ENOUGH = 0.1
# a direction of the coefficients that nothing tells, relative to one that one column tells alone
_UNTOLD = 1e-7


@dataclasses.dataclass(frozen=True)
class At:
    """The runs followed by a vehicle under a disturbance, its columns of unit length, their priors, and the lengths.

    Columns and what is made of them are NumPy arrays: their algebra is small, and worth no program.

    `gram` are the columns' products, priors included, and `spread` half the log-determinant of the covariance; `tame`
    is the number of the damping by which a step led here.
    """

    vehicle: AbstractVehicle
    disturbance: Disturbance
    followed: Followed
    base: Columns
    prior: Float[np.ndarray, "p1 p1"]
    length: Float[np.ndarray, " p"]
    gram: Float[np.ndarray, "p1 p1"]
    spread: float
    tame: int = 0

    @cached_property
    @quietly
    def cost(self) -> float:
        """Minus the log restricted likelihood; no number where the columns' products are not positive definite."""
        among, across = self.gram[1:, 1:], self.gram[1:, 0]
        sign, logarithm = np.linalg.slogdet(among)
        if not sign > 0.0:
            return np.nan
        left = self.gram[0, 0] - across @ np.linalg.solve(among, across)
        return self.spread + 0.5 * float(logarithm + left)

    @property
    def as_they_are(self) -> float:
        """Minus the log likelihood of its numbers."""
        return 0.5 * float(self.gram[0, 0]) + self.spread


@dataclasses.dataclass(frozen=True)
class Led:
    """The recordings of a problem, by which vehicles with other numbers are led from initial states of mean `start`."""

    problem: Problem
    start: Array

    @quietly
    def at(self, vehicle: AbstractVehicle, disturbance: Disturbance) -> At:
        """With the residual's and the parameters' columns in units in which each of the latter is of length one."""
        problem, names = self.problem, [row.name for row in vehicle.layout.free]
        disturbance = jax.tree.map(np.asarray, disturbance)
        followed = follow(vehicle, problem.runs, problem.sigma, disturbance, self.start, problem.spread)
        found = np.asarray(followed.products)[: 1 + len(names), : 1 + len(names)]
        length = root_or_one(np.diag(found)[1:])
        unit = np.concatenate([np.ones(1), length])
        values = vehicle.values()
        away = np.asarray(problem.prior_mean) - np.array([float(values[name]) for name in names])
        pulled = np.column_stack([away, np.diag(1.0 / length)]) / np.asarray(problem.prior_std)[:, None]
        prior = pulled.T @ pulled + np.diag([0.0, *[_UNTOLD] * len(names)])
        base = jax.tree.map(lambda a, b: np.concatenate([a, b], axis=-1) / unit, followed.residual, followed.theta)
        gram = found / np.outer(unit, unit) + prior
        return At(vehicle, disturbance, followed, base, prior, length, gram, float(followed.spread))

    @quietly
    def descend(self, at: At) -> At:
        """Where a scoring step leads, or one that is damped (Levenberg 1944), within the bounds of each number; no step
        where none makes the recordings more probable, nor one that promises next to nothing. The first that is tried is
        damped a little less than the last.
        """
        rows = at.vehicle.layout.free
        here = np.array([float(at.vehicle.values()[row.name]) for row in rows])
        low, high = (np.array([(row.lower, row.upper) for row in rows]).reshape(-1, 2).T - here) * at.length
        for tame in range(max(at.tame - 1, 0), len(_DAMPED)):
            step = _step(at.gram, _DAMPED[tame], low, high)
            if _promised(at.gram, step) < _ENOUGH:
                return at
            moved = here + step / at.length
            named = {row.name: np.asarray(value) for row, value in zip(rows, moved, strict=True)}
            trial = self.at(at.vehicle.with_values(named), at.disturbance)
            if trial.as_they_are < at.as_they_are:
                return dataclasses.replace(trial, tame=tame)
        return at


def _step(gram: np.ndarray, damped: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The step of least squares between bounds, of the products (p + 1, p + 1) of a residual and its columns.

    One that is cut off at a bound leads astray in all that trades with it.
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


def of_order(problem: Problem) -> Problem:
    """A problem with a wide prior about each number of the file that has none."""
    vehicle, own = problem.vehicle, problem.vehicle.own_values()
    width, given = PRIOR_WIDTH * np.abs(problem.prior_mean), [row.name in own for row in vehicle.layout.free]
    wide = np.array(given, bool) & (width > 0.0) & np.isinf(problem.prior_std)
    return dataclasses.replace(problem, prior_std=jax.device_put(np.where(wide, width, problem.prior_std)))


Costed = TypeVar("Costed", Ended, At)


def by_cost(found: Iterable[Costed]) -> list[Costed]:
    """Those of the least `cost` first, and what has no finite one last."""
    return sorted(found, key=lambda one: float(one.cost) if np.isfinite(float(one.cost)) else np.inf)


def turned(led: Led, at: At) -> At:
    """The disturbance sought for the numbers, and the numbers under it; or half as far, or as it was, if that is worse.

    It is sought along the path that the former disturbance led, and another may lead elsewhere.
    """
    for disturbance in _towards(at):
        after = led.descend(led.at(at.vehicle, disturbance))
        if by_cost([at, after])[0] is after:
            return after
    return at


def _towards(at: At) -> Iterator[Disturbance]:
    """The disturbance that its numbers ask for, and one half as far."""
    found = estimate_disturbance(at.followed.system, at.base, at.prior, at.disturbance)
    for share in _SHARES:
        towards = lambda old, new, share=share: old * (np.asarray(new) / old) ** share
        yield jax.tree.map(towards, at.disturbance, found)


def apart(found: Iterable[At]) -> list[At]:
    """By cost, one of those that came to the same place."""
    kept: list[At] = []
    for at in by_cost(found):
        if not kept or not abs(at.cost - kept[-1].cost) < _STAYS:
            kept.append(at)
    return kept


def settled(led: Led, at: At) -> At:
    """Both, in turns until they stay; what has no finite cost stays."""
    for _ in range(_TURNS):
        before, at = at, turned(led, at)
        if not abs(before.cost - at.cost) >= _STAYS:
            break
    return at


def arrived(led: Led, at: At) -> At:
    """Both, in turns, the numbers under each disturbance as far as they go, until the recordings gain nothing."""
    at = _descended(led, at)
    for _ in range(_TURNS):
        tries = (_descended(led, led.at(at.vehicle, disturbance)) for disturbance in _towards(at))
        better = next((after for after in tries if at.as_they_are - after.as_they_are >= _GAINED), None)
        if better is None:
            break
        at = better
    return at


def _descended(led: Led, at: At) -> At:
    """Steps until they gain nothing."""
    for _ in range(_STEPS):
        before, at = at, led.descend(at)
        if not before.as_they_are - at.as_they_are >= _GAINED:
            break
    return at
