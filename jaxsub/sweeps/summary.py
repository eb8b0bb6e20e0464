"""What a sweep says: how many searches succeeded, the basins they ended in, and how far the estimates lie apart."""

from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray

from ..estimate import Assessment, Found, Problem, Rate, assess_residuals, basins
from ..estimate.method import problems
from ..estimate.starts import MARGIN
from ..likelihood import output_errors
from ..results import OUTCOMES, SUCCESSFUL
from .plan import Plan

_LISTED = 5


def summarised(plan: Plan, dataset: xarray.Dataset) -> dict[str, Any]:
    """The summary of a sweep as JSON has it; `dataset` is what `sweep` gave for `plan`.

    A success is a search that came within `estimate.MARGIN` of the least cost that any start found on the same
    recordings. Basins are those of the `basins_of` searches on the first noise, and `assessment` says whether the best
    of these explains the recordings. Of coefficients it has the best start's estimate; the percentiles
    of all ends that are numbers; and, where there are seeds of noise, the standard deviation of the best estimates
    over them beside the standard error that each claims on average.
    """
    done = np.asarray(dataset.done)
    cases = [_case(plan, index, dataset.sel(vehicle=v, recording=r)) for index, (v, r) in enumerate(plan.cases)]
    return {
        "schema": 1,
        "plan": dataset.attrs["plan"],
        "searches": int(done.size),
        "done": int(done.sum()),
        "cases": cases,
    }


def best_starts(case: xarray.Dataset) -> np.ndarray:
    """(noise,) the start that found the least cost, for each noise."""
    return np.argmin(_costs(case), axis=1)


def succeeded(case: xarray.Dataset) -> np.ndarray:
    """(noise, start) whether a search of `case` came within `MARGIN` of the least cost known."""
    cost = _costs(case)
    return cost < np.min(cost, axis=1, keepdims=True) + MARGIN


def _costs(case: xarray.Dataset) -> np.ndarray:
    """(noise, start) costs, infinite where there is none."""
    cost = np.asarray(case.cost.transpose("noise", "start"))
    return np.where(np.isfinite(cost), cost, np.inf)


def _case(plan: Plan, index: int, case: xarray.Dataset) -> dict[str, Any]:
    outcome = np.asarray(case.outcome)[np.asarray(case.done)]
    counts = np.bincount(outcome, minlength=len(OUTCOMES))
    good, best = succeeded(case), best_starts(case)
    found, lost = _basins(plan, index, case)
    vehicle, recorded = plan.cases[index]
    return {
        "vehicle": vehicle,
        "recording": recorded,
        "outcomes": {name: int(count) for name, count in zip(OUTCOMES, counts, strict=True) if count},
        "success": Rate(int(good.sum()), int(good.size)).to_json(),
        "assessment": _assessed(plan, index, case, int(best[0])).to_json(),
        "margin": MARGIN,
        "least_cost": _number(_costs(case)[0, best[0]]),
        "basins_of": plan.starts,
        "basins_found": len(found),
        "basins": [{"cost": basin.cost, "count": basin.count} for basin in found[:_LISTED]],
        "without_an_end": lost,
        "evaluations_median": float(np.median(np.asarray(case.evaluations)[np.asarray(case.done)])),
        "coefficients": _coefficients(plan.problems[index].vehicle.layout.free, case, best),
    }


def _basins(plan: Plan, index: int, case: xarray.Dataset) -> tuple[list, int]:
    problem, first = plan.problems[index], case.isel(noise=0)
    y = np.asarray(first.coordinates)[:, : len(problem.coordinates())]
    cost, evaluations = (jnp.asarray(np.asarray(values)) for values in (first.cost, first.evaluations))
    return basins(_first_noise(plan, index), Found(jnp.asarray(y), cost, evaluations, SUCCESSFUL))


def _first_noise(plan: Plan, index: int) -> Problem:
    """The problem of a case with the recordings of the first noise."""
    return problems(plan.problems[index], plan.outputs(index, np.arange(1)))(jnp.asarray(0))


def _assessed(plan: Plan, index: int, case: xarray.Dataset, best: int) -> Assessment:
    """Whether the estimate from the start `best` explains the recordings of the first noise."""
    problem, layout = _first_noise(plan, index), plan.problems[index].vehicle.layout
    y = np.asarray(case.coordinates)[0, best][: len(problem.coordinates())]
    mask, known = np.asarray(problem.runs.mask), [output.sigma is not None for output in layout.outputs]
    residual = np.full(mask.shape, np.nan)
    if np.isfinite(y).all():
        vehicle, start = problem.split(jnp.asarray(y))
        residual = np.asarray(output_errors(vehicle, problem.runs, start) / problem.sigma)
    return assess_residuals(layout.channels, residual, mask, len(y), known)


def _coefficients(rows: list, case: xarray.Dataset, best: np.ndarray) -> dict[str, Any]:
    noise, numbers = np.arange(len(best)), {}
    for row in rows:
        own = case.sel(coefficient=row.name)
        ends = np.asarray(own.estimate)
        finite = ends[np.isfinite(ends) & np.isfinite(np.asarray(own.cost))]
        chosen, errors = ends[noise, best], np.asarray(own.standard_error)[noise, best]
        numbers[row.name] = {
            "unit": row.unit,
            "file_value": float(own.file_value),
            "best": _number(chosen[0]),
            "standard_error": _number(errors[0]),
            "percentiles_5_50_95": [_number(p) for p in np.percentile(finite, (5, 50, 95))] if finite.size else None,
        }
        if len(noise) > 1:
            numbers[row.name] |= {
                "mean_over_noise": _number(np.mean(chosen)),
                "spread_over_noise": _number(np.std(chosen, ddof=1)),
                "standard_error_mean": _number(np.mean(errors)),
            }
    return numbers


def _number(value: float | np.floating) -> float | None:
    """A number as JSON has it, which knows neither NaN nor infinity."""
    return float(value) if np.isfinite(value) else None
