r"""Numbers that differ by run: $\theta_r = \bar\theta + \Delta_r$, $\Delta_r\sim N(0, s^2)$, and each run's own value.

$\Delta_r$ is an initial state of the run, so a fit has its most probable value for a given s. About such a fit the
model is linear in coefficients, initial states and $\Delta_r$, and s maximises the likelihood with all of those
integrated out: the restricted likelihood of a linear mixed model. For R runs that measure $\theta_r$ exactly it gives
$s^2 = \sum(\theta_r - \bar\theta)^2/(R-1)$. Source: Pinheiro and Bates (2000), §2.2 and §7.2.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import Array, Float

from ..arrays import quietly
from ..errors import InputError
from ..likelihood.blocks import summed_products
from ..vehicle import AbstractVehicle
from .problem import Problem

# of a number's own size, where the search for its standard deviation between runs starts: wide, so that each run's
# value is nearly that of the run alone
_WIDE = 0.1
# logarithms of a standard deviation relative to where its search starts, and those that it starts from
_NARROWEST, _WIDEST, _STARTS = -12.0, 12.0, (0.0, -3.0)
# a gain of log likelihood over no difference at all that is rounding
_NOTHING = 1e-6
# of those logarithms, for differences of slopes
_STEP = 0.01
# of a coefficient's own information, what the data say at least
_RIDGE = 1e-12


@dataclasses.dataclass(frozen=True)
class RunValues:
    """A number that differs by run.

    **Fields**

    - `name`, `unit`: SI. `spread`: standard deviation between runs; `estimated`: whether it was not given.
    - `spread_error`: its standard error, None where it was given or is zero.
    - `values`, `errors`: (R,) each run's own value, and its standard error for white residuals of the given σ.
    """

    name: str
    unit: str
    spread: float
    estimated: bool
    spread_error: float | None
    values: np.ndarray
    errors: np.ndarray

    def to_json(self, runs: Sequence[str]) -> dict[str, Any]:
        """As files have it, the `runs` by name."""
        spread = {"value": self.spread, "standard_error": self.spread_error, "estimated": self.estimated}
        each = zip(runs, self.values, self.errors, strict=True)
        own = [{"run": run, "value": float(value), "standard_error": float(error)} for run, value, error in each]
        return {"unit": self.unit, "spread": spread, "runs": own}

    def sentence(self) -> str:
        """What differs, and by how much."""
        if not self.spread > 0.0:
            return f"{self.name}: the {len(self.values)} runs do not differ beyond their noise; all have the mean."
        error = f" (standard error {self.spread_error:.2g})" if self.spread_error is not None else ""
        size = f"{self.spread:.3g} {self.unit}".rstrip()
        source = f"estimated from {len(self.values)} runs" if self.estimated else "as given"
        return f"{self.name} differs by run: standard deviation between runs {size}{error}, {source}."


def unknown_spreads(vehicle: AbstractVehicle) -> tuple[str, ...]:
    """The numbers whose standard deviation between runs is still to be estimated."""
    return tuple(name for name, spread in vehicle.spreads.items() if np.isnan(float(spread)))


def require_runs(vehicle: AbstractVehicle, runs: int, where: str) -> None:
    """So many runs show how much the numbers of `vehicle`, read from `where`, differ by run.

    **Raises** `InputError` where one run has to.
    """
    names = unknown_spreads(vehicle)
    if names and runs < 2:
        what = f"{', '.join(names)} differ{'s' if len(names) == 1 else ''} by run, and there is one run"
        raise InputError(where, what, "give more runs, or spread = … beside varies")


def wide_spreads(vehicle: AbstractVehicle, names: Sequence[str]) -> dict[str, float]:
    """Standard deviations between runs from which the search for those of `names` starts."""
    values = vehicle.values()
    sizes = {name: _WIDE * abs(float(values[name])) for name in names}
    priors = {row.name: row.prior_std for row in vehicle.layout.free}
    return {name: size or (priors[name] if np.isfinite(priors[name]) else 1.0) for name, size in sizes.items()}


@quietly
def estimate_spreads(problem: Problem, y: Float[Array, " d"], names: Sequence[str]) -> dict[str, float]:
    """The standard deviations between runs of the numbers `names` about the fit at `y`; zero where runs do not differ.

    Not to be called in `jit`.
    """
    from scipy.optimize import minimize

    vehicle, start = problem.split(y)
    units = {name: max(float(vehicle.spreads[name]), size) for name, size in wide_spreads(vehicle, names).items()}
    mixed = Mixed.of(with_spreads(problem, units), vehicle, start, names)
    box = [(_NARROWEST, _WIDEST)] * len(names)
    found = [minimize(mixed.expand, np.full(len(names), at), jac=True, method="L-BFGS-B", bounds=box) for at in _STARTS]
    best = np.asarray(min(found, key=lambda end: end.fun).x)
    for i in range(len(names)):
        without = np.where(np.arange(len(names)) == i, -np.inf, best)
        if mixed.expand(without)[0] < mixed.expand(best)[0] + _NOTHING:
            best = without
    return {name: units[name] * float(np.exp(log)) for name, log in zip(names, best, strict=True)}


def run_variations(
    problem: Problem,
    products: Float[Array, "r q q"],
    start: Float[Array, "r s"],
    covariance: Float[Array, "p p"],
    estimated: Sequence[str],
) -> tuple[RunValues, ...]:
    """The numbers that differ by run at an optimum.

    `products` and `covariance` are those of its `Solution`, `start` its initial states, `estimated` the numbers whose
    standard deviation between runs was not given.
    """
    vehicle, states = problem.vehicle, problem.vehicle.layout.states
    gram, spread, p = np.asarray(products), np.asarray(problem.start_std), len(problem.prior_mean)
    free = [row.name for row in vehicle.layout.free]
    own = np.linalg.inv(gram[:, p:-1, p:-1] + np.eye(len(spread)))
    # how the initial states follow the coefficients
    gain = own @ gram[:, p:-1, :p]
    known = [name for name in estimated if float(vehicle.spreads[name]) > 0.0]
    spread_errors = dict(zip(known, Mixed.of(problem, vehicle, start, known, gram).errors(), strict=True))
    values, found = vehicle.values(), []
    for state, row in vehicle.layout.deviations.items():
        at, size = states.index(state), float(vehicle.spreads[row.name])
        moved = (np.array(free) == row.name) - spread[at] * gain[:, at]
        variance = spread[at] ** 2 * own[:, at, at] + np.einsum("rp,pq,rq->r", moved, np.asarray(covariance), moved)
        error = spread_errors.get(row.name, np.nan)
        spread_error = float(size * error) if np.isfinite(error) else None
        own_values = float(values[row.name]) + np.asarray(start)[:, at]
        given = row.name not in estimated
        found.append(RunValues(row.name, row.unit, size, not given, spread_error, own_values, np.sqrt(variance)))
    return tuple(found)


@dataclasses.dataclass(frozen=True)
class Mixed:
    """A linear mixed model of R runs, its standard deviations between runs in units of those of a problem.

    **Fields**

    - `gram`: (R, q, q) products of each run's whitened columns: by the p coefficients (in their own sizes), by its
      initial state in its spread, and the error where that initial state is the guess.
    - `prior`: (p+1, p+1) the same of the priors. `varied`: indices of the states whose standard deviation is needed.
    """

    gram: Float[np.ndarray, "r q q"]
    prior: Float[np.ndarray, "p1 p1"]
    varied: list[int]

    @classmethod
    def of(
        cls,
        problem: Problem,
        vehicle: AbstractVehicle,
        start: Float[Array, "r s"],
        names: Sequence[str],
        products: Float[np.ndarray, "r q q"] | None = None,
    ) -> "Mixed":
        """About `vehicle` and its initial states `start`; `products` of its columns where they are there already."""
        if products is None:
            found = summed_products(vehicle, problem.runs, start, problem.sigma, problem.start_std)
            products = np.asarray(found)
        p, spread = len(problem.prior_mean), np.asarray(problem.start_std)
        moved = (np.asarray(start) - np.asarray(problem.guess)) / np.where(spread > 0.0, spread, 1.0)
        q = products.shape[-1]
        back = np.tile(np.eye(q), (len(moved), 1, 1))
        back[:, p:-1, -1] = np.where(spread > 0.0, moved, 0.0)
        gram = np.swapaxes(back, 1, 2) @ products @ back
        values = vehicle.values()
        at = np.array([float(values[row.name]) for row in vehicle.layout.free])
        pulled = np.concatenate([np.eye(p), (np.asarray(problem.prior_mean) - at)[:, None]], axis=1)
        weight = np.asarray(problem.prior_std) ** -2.0
        prior = pulled.T @ (weight[:, None] * pulled)
        # the search does not depend on units, and a coefficient without a trace does not hide the others
        size = np.sqrt(np.einsum("rii->i", gram[:, :p, :p]) + weight)
        scale = np.concatenate([np.where(size > 0.0, size, 1.0), np.ones(q - p)])
        own = np.append(scale[:p], 1.0)
        states = vehicle.layout.states
        varied = [states.index(s) for s, row in vehicle.layout.deviations.items() if row.name in names]
        return cls(gram / np.outer(scale, scale), prior / np.outer(own, own), varied)

    def expand(self, logs: Float[np.ndarray, " v"]) -> tuple[float, Float[np.ndarray, " v"]]:
        r"""Minus the log restricted likelihood at the logarithms of the standard deviations, and its gradient.

        That is $\sum_r (1 - E[z_r^2])$, of the deviations z in units of their standard deviation given the data: the
        identity of Fisher, as an expectation–maximisation uses it.
        """
        p, n = len(self.prior) - 1, self.gram.shape[1] - len(self.prior)
        scale = np.ones(n)
        scale[self.varied] = np.exp(logs)
        shared = [*range(p), -1]
        own = scale[:, None] * self.gram[:, p:-1, p:-1] * scale + np.eye(n)
        across = scale[:, None] * self.gram[:, p:-1, shared]
        inverse = np.linalg.inv(own)
        through = inverse @ across
        left = np.sum(self.gram[:, shared][:, :, shared] - np.swapaxes(across, 1, 2) @ through, axis=0) + self.prior
        fixed = left[:p, :p] + _RIDGE * np.eye(p)
        covariance = np.linalg.inv(fixed)
        change = covariance @ left[:p, p]
        squares = left[p, p] - left[p, :p] @ change
        cost = 0.5 * (squares + np.linalg.slogdet(own)[1].sum() + np.linalg.slogdet(fixed)[1])
        z = through[..., p] - through[..., :p] @ change
        variance = np.diagonal(inverse, axis1=1, axis2=2)
        variance = variance + np.einsum("rnp,pq,rnq->rn", through[..., :p], covariance, through[..., :p])
        return float(cost), np.sum(1.0 - z**2 - variance, axis=0)[self.varied]

    def errors(self) -> Float[np.ndarray, " v"]:
        """Standard errors of the logarithms, at zero, by the curvature there; NaN where it has none."""
        slope = lambda change: self.expand(change)[1]
        steps = _STEP * np.eye(len(self.varied))
        curvature = np.array([(slope(step) - slope(-step)) / (2.0 * _STEP) for step in steps])
        with np.errstate(invalid="ignore"):
            return np.sqrt(np.diag(np.linalg.pinv(curvature.reshape(len(steps), len(steps)))))


def with_spreads(problem: Problem, spreads: Mapping[str, float]) -> Problem:
    """The problem with other standard deviations between runs."""
    vehicle = problem.vehicle.with_spreads(spreads)
    rows = vehicle.layout.deviations
    own = [float(vehicle.spreads[rows[s].name]) if s in rows else None for s in vehicle.layout.states]
    now = np.asarray(problem.start_std)
    spread = np.array([old if new is None else new for old, new in zip(now, own, strict=True)], float)
    return dataclasses.replace(problem, vehicle=vehicle, start_std=jax.device_put(spread))
