"""One `fit`, one `Solution`: maximum likelihood by whichever method."""

import dataclasses
from collections.abc import Sequence
from typing import final

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, quietly
from ..filter.vehicle import unfilterable
from ..likelihood import BlockLinearised, concentrated_sigma, output_errors
from ..likelihood.blocks import Watch, nobody
from ..programs import compiled
from ..recording import Recording
from ..recording.runs import Runs
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .batches import batch
from .between_runs import (
    RunValues,
    estimate_spreads,
    require_runs,
    run_variations,
    unknown_spreads,
    wide_spreads,
    with_spreads,
)
from .method import AbstractMethod, Passes, unwatched
from .methods import filtered_first, gauss_newton
from .optimum import inertia, statistics_at_end
from .problem import Problem

_CONCENTRATIONS = 12
# of a standard deviation, a change that ends its estimation
_SETTLED = 0.003


class AbstractSearchEnd(eqx.Module):
    """A vehicle with the numbers that a search found for R runs, and how the search ended.

    **Fields**

    - `vehicle`: with the numbers found. `start`: (R, s) initial states, SI. `sigma`: (c,) noise, SI.
    - `cost`: ½ Σ whitened residuals², priors included. `steps`: evaluations by the search. `result`: a `RESULTS` value.
    - `known_start`: whether `start` was given. `estimated_spreads`: the numbers that differ by run whose standard
      deviation between runs was estimated.
    """

    vehicle: eqx.AbstractVar[AbstractVehicle]
    runs: eqx.AbstractVar[Runs]
    start: eqx.AbstractVar[Float[Array, "r s"]]
    sigma: eqx.AbstractVar[Float[Array, " c"]]
    cost: eqx.AbstractVar[Float[Array, ""]]
    steps: eqx.AbstractVar[Array]
    result: eqx.AbstractVar[RESULTS]
    known_start: eqx.AbstractVar[bool]
    estimated_spreads: eqx.AbstractVar[tuple[str, ...]]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the p free parameters."""
        return tuple(row.name for row in self.vehicle.layout.free)

    @property
    def values(self) -> dict[str, float]:
        """Fitted free parameters by name."""
        values = self.vehicle.values()
        return {name: float(values[name]) for name in self.names}

    @property
    def converged(self) -> bool:
        """Whether the search ended at an optimum."""
        # a comparison of results would be a program; of success there is no message
        return not RESULTS[self.result]

    @property
    def problem(self) -> Problem:
        """The least-squares problem of which this is the optimum."""
        start = self.start if self.known_start else None
        return Problem.of(self.vehicle, self.runs, self.sigma, start, known_start=self.known_start)


@final
class SearchEnd(AbstractSearchEnd):
    """Where a search ended, without any statistics; fields as of `AbstractSearchEnd`."""

    vehicle: AbstractVehicle
    runs: Runs
    start: Float[Array, "r s"]
    sigma: Float[Array, " c"]
    cost: Float[Array, ""]
    steps: Array
    result: RESULTS
    known_start: bool = eqx.field(static=True, default=False, kw_only=True)
    estimated_spreads: tuple[str, ...] = eqx.field(static=True, default=(), kw_only=True)


@final
class Solution(AbstractSearchEnd):
    """What an estimation found: where its search ended, with statistics.

    **Fields** beside those of `AbstractSearchEnd`

    - `covariance`: (p, p) of the free parameters, SI; the initial states' uncertainty is included.
    - `model`: the vehicle linearised along the fitted trajectory, block by block.
    - `gradient_norm`: largest |∂cost/∂y| in scaled coordinates, relative to the largest curvature's square root: how
      many standard errors the optimum within bounds may still be away.
    - `pressed`: (p,) without a unit: -1 for a parameter that presses on its lower bound, 1 on its upper one, else 0.
    """

    vehicle: AbstractVehicle
    runs: Runs
    start: Float[Array, "r s"]
    sigma: Float[Array, " c"]
    cost: Float[Array, ""]
    steps: Array
    result: RESULTS
    covariance: Float[Array, "p p"]
    model: BlockLinearised
    gradient_norm: Float[Array, ""]
    pressed: Float[Array, " p"]
    known_start: bool = eqx.field(static=True, default=False, kw_only=True)
    estimated_spreads: tuple[str, ...] = eqx.field(static=True, default=(), kw_only=True)

    @property
    def at_optimum(self) -> bool:
        """Whether the search ended at an optimum, or its steps ran out within a standard error of one."""
        out_of_steps = RESULTS[self.result] == RESULTS[RESULTS.nonlinear_max_steps_reached]
        return self.converged or (out_of_steps and float(self.gradient_norm) < 1.0)

    @property
    def at_bound(self) -> dict[str, str]:
        """Of each parameter that presses on a bound, which: `lower` or `upper`."""
        sides = zip(self.names, np.asarray(self.pressed), strict=True)
        return {name: "lower" if side < 0.0 else "upper" for name, side in sides if side}

    @property
    def standard_errors(self) -> dict[str, float]:
        """Their standard errors."""
        return dict(zip(self.names, np.sqrt(np.diag(np.asarray(self.covariance))).tolist(), strict=True))

    @property
    def variations(self) -> tuple[RunValues, ...]:
        """The numbers that differ by run: mean, standard deviation between runs, and each run's own value."""
        return self.varying(self.estimated_spreads)

    def varying(self, estimated: Sequence[str]) -> tuple[RunValues, ...]:
        """The same, the standard deviations of the numbers `estimated` being estimates, which have errors."""
        return run_variations(self.problem, self.model.products, self.start, self.covariance, estimated)

    @property
    @quietly
    def residual(self) -> Float[np.ndarray, "r k c"]:
        """Whitened residuals."""
        return np.asarray(self.model.error) / np.asarray(self.sigma)

    @property
    def rms(self) -> dict[str, float]:
        """rms(residual)/σ of each channel: 1 is the noise floor."""
        return channel_rms(self.residual, self.runs, self.vehicle.layout.channels)


@quietly
def channel_rms(residual: Values, runs: Runs, channels: tuple[str, ...]) -> dict[str, float]:
    """rms of a whitened `residual` (R, K, c) of `runs` by the names `channels`, over what was measured."""
    samples = np.sum(np.asarray(runs.mask), axis=(0, 1))
    mean_square = np.sum(np.asarray(residual) ** 2, axis=(0, 1)) / np.maximum(samples, 1.0)
    return dict(zip(channels, np.sqrt(mean_square).tolist(), strict=True))


def channel_noise(vehicle: AbstractVehicle, runs: Runs) -> Float[Array, " c"]:
    """(c,) noise of the channels of `vehicle`, SI: its file's; where that is open, as its fit to `runs` leaves it."""
    given = [output.sigma for output in vehicle.layout.outputs]
    return search(vehicle, runs, moving=False).sigma if None in given else jnp.asarray(given, float)


def search(
    vehicle: AbstractVehicle,
    runs: Runs,
    *,
    method: AbstractMethod | None = None,
    sigma: Array | None = None,
    start: Array | None = None,
    moving: bool = True,
    known_start: bool = False,
    passes: Passes | None = None,
) -> SearchEnd:
    """The maximum-likelihood vehicle, initial states and noise.

    `method` is Gauss–Newton where none is given. `known_start` takes the initial states `start` for the truth. `moving`
    false keeps the vehicle and finds the initial states alone, as for a run that the fit did not see.
    Noise comes from `sigma`, else from the vehicle file; channels whose noise is to be estimated have it concentrated
    out: fit, take the rms, fit again from there, until it settles. So have numbers that differ by run their standard
    deviation between runs, where the vehicle knows none and may move. `passes` is called as by `AbstractMethod.run`.

    **Raises** `InputError` where that is to be estimated from one run.
    """
    given = [output.sigma for output in vehicle.layout.outputs]
    estimated = np.array([s is None and sigma is None for s in given], bool)
    noise = np.array([s or 1.0 for s in given], float) if sigma is None else sigma
    if estimated.any():
        noise = np.where(estimated, np.asarray(_signal(runs)), noise)
    noise = jax.device_put(noise)
    varied = unknown_spreads(vehicle) if moving and not known_start else ()
    if varied:
        require_runs(vehicle, len(runs.times), vehicle.layout.name)
    vehicle = vehicle.with_spreads(wide_spreads(vehicle, varied)) if varied else vehicle
    problem = Problem.of(vehicle, runs, noise, start, moving=moving, known_start=known_start)
    return concentrated(problem, problem.coordinates(), estimated, varied, method, passes)


def concentrated(
    problem: Problem,
    y: Float[Array, " d"],
    estimated: np.ndarray,
    varied: tuple[str, ...],
    method: AbstractMethod | None = None,
    passes: Passes | None = None,
) -> SearchEnd:
    """The end of a search from `y`, with the noise of channels `estimated` (c,) and the deviations of numbers `varied`.

    Both are found anew at each end, until they settle.
    """
    runs, total = problem.runs, 0
    for _ in range(_CONCENTRATIONS):
        found = (method or gauss_newton()).run(problem, jax.device_put(np.asarray(y)[None]), passes=passes).one(0)
        y, cost, result = found.y, found.cost, found.result
        total += int(found.evaluations)
        fitted, states = problem.split(y)
        if not (estimated.any() or varied) or not np.isfinite(cost):
            break
        settled = True
        if estimated.any():
            rms = concentrated_sigma(output_errors(fitted, runs, states), runs)
            settled = bool(jnp.all(jnp.abs(rms / problem.sigma - 1.0) < _SETTLED, where=estimated))
            # a channel without errors, such as one that was never measured, says nothing of its noise
            problem = dataclasses.replace(problem, sigma=jnp.where(estimated & (rms > 0.0), rms, problem.sigma))
        if varied:
            spreads = estimate_spreads(problem, y, varied)
            now = {name: float(problem.vehicle.spreads[name]) for name in varied}
            same = all(abs(spreads[name] - now[name]) <= _SETTLED * spreads[name] for name in varied)
            if not (settled and same):
                # coordinates are in units of the standard deviation, and the values stay
                problem = with_spreads(problem, spreads)
                y = problem.coordinates_of(fitted, states)
            settled = settled and same
        if settled:
            break
    return SearchEnd(
        fitted, runs, states, problem.sigma, cost, jax.device_put(total), result, known_start=problem.known_start,
        estimated_spreads=varied,
    )  # fmt: skip


@compiled
def _signal(runs: Runs) -> Array:
    """The standard deviation of each measured channel: where the search for its noise starts."""
    count = jnp.maximum(runs.samples(), 1.0)
    mean = jnp.sum(runs.outputs, (0, 1)) / count
    spread = jnp.sqrt(jnp.sum(jnp.where(runs.mask, runs.outputs - mean, 0.0) ** 2, (0, 1)) / count)
    return jnp.where(spread > 0.0, spread, 1.0)


def fit(
    vehicle: AbstractVehicle,
    recordings: Sequence[Recording] | Runs,
    *,
    method: AbstractMethod | None = None,
    sigma: Array | None = None,
    start: Array | None = None,
    known_start: bool = False,
    passes: Passes | None = None,
) -> Solution:
    """Fit the free numbers of `vehicle`, and an initial state for each run, to `recordings` or the `batch` of them.

    `method` is Gauss–Newton where none is given; where that does not run or arrive, also from the end of a filter, and
    the more probable is taken. The simulation of an unstable model diverges, while a filter follows the
    measurements, and its estimates allow for missing physics. `sigma` overrides the file's noise; `start` is
    where the initial states' search begins, or with `known_start` what they are. A failure is a value in
    `Solution.result`, no exception. `passes` is called with how many passes over long runs are done and expected
    (`AbstractMethod.run`).
    """
    runs = recordings if isinstance(recordings, Runs) else batch(vehicle, recordings)
    by = lambda method: _fitted(vehicle, runs, method, sigma, start, known_start, passes)
    found = by(method)
    if method is None and not found.converged and not unfilterable(vehicle):
        found = min(found, by(filtered_first()), key=_improbable)
    return found


def _fitted(
    vehicle: AbstractVehicle,
    runs: Runs,
    method: AbstractMethod | None,
    sigma: Array | None,
    start: Array | None,
    known_start: bool,
    passes: Passes | None,
) -> Solution:
    tell = passes or unwatched
    # one pass more, for the statistics
    with_statistics = lambda done, expected: tell(done, expected + 1.0)
    ended = search(
        vehicle, runs, method=method, sigma=sigma, start=start, known_start=known_start, passes=with_statistics
    )
    taken = int(ended.steps)
    return evaluate(ended, lambda share: tell(taken + share, taken + 1.0))


def _improbable(found: Solution) -> float:
    """Minus the log likelihood, noise that was estimated included; infinite where the model did not run."""
    value = float(found.cost + jnp.sum(found.runs.samples() * jnp.log(found.sigma)))
    return value if np.isfinite(value) else np.inf


def evaluate(ended: AbstractSearchEnd, watch: Watch = nobody) -> Solution:
    """The statistics of `ended`; itself where it has them. `watch` is called with the share of samples done."""
    if isinstance(ended, Solution):
        return ended
    problem = ended.problem
    model = BlockLinearised.of(ended.vehicle, ended.runs, ended.start, ended.sigma, problem.start_std, watch)
    covariance, gradient, pressed, result = statistics_at_end(
        problem.without_vehicle, problem.values, inertia(problem.vehicle), model.products, ended.result
    )
    fields = {field.name: getattr(ended, field.name) for field in dataclasses.fields(ended)}
    fields["result"] = result
    return Solution(**fields, covariance=covariance, model=model, gradient_norm=gradient, pressed=pressed)
