"""The modified extended Kalman filter on-line and in single precision: time of a step, and what square roots save."""

import dataclasses
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import Problem
from jaxsub.filter import (
    AbstractForm,
    Covariance,
    ModifiedKalmanFilter,
    Sample,
    SquareRoot,
    VehicleProcess,
    on_line,
    over_runs,
    samples,
    vehicle_filter,
)
from jaxsub.vehicle.catalogue import nps_auv_ii

from . import setup
from .figures import latencies

# how well the parameters are known before the first sample, in their own sizes: single precision feels the contraction
SPREADS = (1.0, 10.0, 100.0)


def run(out: Path, quick: bool) -> dict:
    """Latency on the vehicle with all 21 coefficients of its catalogue free, and agreement of float32 with float64."""
    spent = steps(setup.problem(nps_auv_ii(), setup.recordings(2, 1)), 1 if quick else 5)
    latencies(1e3 * spent, out / "mekf_latency.png")
    milliseconds = {f"p{q:g}": float(1e3 * np.percentile(spent, q)) for q in (50, 90, 99)}
    return {
        "on_line_step_ms": milliseconds | {"worst": float(1e3 * spent.max()), "steps": len(spent)},
        "single_precision": {f"{spread:g}": precision(spread) for spread in SPREADS},
    }


def made(problem: Problem, form: AbstractForm) -> ModifiedKalmanFilter:
    """The filter of a problem, its uncertainty kept as `form` keeps it."""
    process = VehicleProcess(problem.vehicle, problem.transform)
    built = vehicle_filter(process, problem.sigma)
    assert isinstance(built, ModifiedKalmanFilter)
    return dataclasses.replace(built, form=form)


def steps(problem: Problem, passes: int) -> np.ndarray:
    """Seconds that each on-line step takes once compiled, one sample at a time, `passes` times over the first run."""
    filter, whole = made(problem, SquareRoot()), samples(problem.runs)
    sequence = [jax.tree.map(lambda leaf, k=k: leaf[0, k], whole) for k in range(whole.elapsed.shape[1])]
    step, p = on_line(filter), len(problem.prior_mean)
    start = filter.start(problem.guess[0], problem.coordinates(), jnp.eye(p))
    jax.block_until_ready(step(start, sequence[1]))
    spent = []
    for _ in range(passes):
        state = start
        for sample in sequence:
            begin = time.perf_counter()
            state, _ = jax.block_until_ready(step(state, sample))
            spent.append(time.perf_counter() - begin)
    return np.array(spent)


def precision(spread: float) -> dict:
    """float32 against float64 after scenario II, the uncertainty kept as a square root and as a covariance."""
    with jax.enable_x64(True):
        reference = final(setup.problem(setup.truth(), setup.recordings(2, 1)), SquareRoot(), spread)
    lines = {}
    for name, form in (("square_root", SquareRoot()), ("covariance", Covariance())):
        with jax.enable_x64(False):
            theta, deviations, least, diverged = final(
                setup.problem(setup.truth(), setup.recordings(2, 1)), form, spread
            )
        lines[name] = {
            "parameters_relative": float(np.linalg.norm(theta - reference[0]) / np.linalg.norm(1.0 + reference[0])),
            "standard_deviations_relative": float(np.max(np.abs(deviations / reference[1] - 1.0))),
            "least_eigenvalue_over_largest": least,
            "diverged": diverged,
        }
    return lines


def final(problem: Problem, form: AbstractForm, spread: float) -> tuple[np.ndarray, np.ndarray, float, bool]:
    """Parameters, their standard deviations, the covariance's least eigenvalue over its largest, and divergence."""
    filter, whole, p = made(problem, form), samples(problem.runs), len(problem.prior_mean)
    away = problem.coordinates() + 0.3 * jnp.asarray(np.random.default_rng(2).choice((-1.0, 1.0), p))

    @jax.jit
    def flown(away: jax.Array, whole: Sample):
        return over_runs(filter, filter.start(problem.guess[0], away, spread * jnp.eye(p)), whole, problem.guess)

    state, _ = flown(away, whole)
    joint = np.asarray(state.joint, float)
    covariance = joint @ joint.T if isinstance(form, SquareRoot) else joint
    deviations = np.asarray(form.deviations(state.joint), float)[-p:]
    values = np.linalg.eigvalsh(covariance + covariance.T) if np.isfinite(covariance).all() else np.array([np.nan])
    least = float(values[0] / values[-1])
    return np.asarray(state.theta, float), deviations, least if np.isfinite(least) else 0.0, bool(state.diverged)
