"""Every estimator on both of the paper's scenarios, from one start, judged by the truth and on runs not fitted."""

import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import METHODS, AbstractMethod, Problem, channel_rms, scattered
from jaxsub.likelihood import output_errors
from jaxsub.recording import Recording
from jaxsub.results import RESULTS
from jaxsub.simulation import at_rest

from . import setup
from .figures import estimates, histories

SPREAD, START_SEED, FIT_SEED, HELD_SEED = 0.3, 7, 1, 101


def run(out: Path, scenario: int) -> dict:
    """All estimators on scenario I or II; writes the histories and the comparison of the estimates as figures."""
    recorded = setup.recordings(scenario, FIT_SEED)
    held_out = setup.recordings(2, HELD_SEED)
    problem = setup.problem(setup.truth(), recorded)
    start = scattered(problem, SPREAD, 1, START_SEED)
    numeral = "I" * scenario
    histories(recorded, out / f"scenario_{scenario}_histories.png", f"Scenario {numeral}")
    results = {name: judged(method(), problem, start, held_out) for name, method in METHODS.items()}
    estimates(results, out / f"scenario_{scenario}_estimates.png", f"Scenario {numeral}: estimate over truth")
    return results


def judged(method: AbstractMethod, problem: Problem, start: jax.Array, held_out: list[Recording]) -> dict:
    """One estimator's line; `seconds` are those of a second run, when everything is compiled."""
    spent = []
    for _ in range(2):
        begin = time.perf_counter()
        found = jax.block_until_ready(method.run(problem, start)).one(0)
        spent.append(time.perf_counter() - begin)
    fitted, result = setup.fitted(problem, found), found.result
    errors = setup.relative_errors(fitted.vehicle, setup.truth())
    sizes = np.abs([errors[name] for name in errors])
    return {
        "relative_error": errors,
        "relative_standard_error": {
            name: size / abs(fitted.values[name]) for name, size in fitted.standard_errors.items()
        },
        "median_relative_error": float(np.median(sizes)),
        "worst_relative_error": float(np.max(sizes)),
        "converged": bool(fitted.result == RESULTS.successful),
        "said": "successful" if bool(result == RESULTS.successful) else RESULTS[result].split(".")[0],
        "standard_errors_from_optimum": float(fitted.gradient_norm),
        "cost": float(found.cost),
        "held_out": free_run(problem, fitted.vehicle, held_out),
        "seconds": spent[1],
        "seconds_with_compilation": spent[0],
        "evaluations": int(found.evaluations),
    }


def free_run(problem: Problem, vehicle, held_out: list[Recording]) -> dict[str, float]:
    """rms(error)/σ by channel and over all, of simulation of recordings that were not fitted."""
    other = setup.problem(vehicle, held_out)
    error = output_errors(vehicle, other.runs, at_rest(vehicle, len(held_out))) / problem.sigma
    return channel_rms(error, other.runs, vehicle.layout.channels) | {"all": float(jnp.sqrt(jnp.mean(error**2)))}
