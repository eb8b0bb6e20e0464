"""Whether nominal 95 % intervals hold the truth in 95 % of experiments: white noise, and coloured disturbances."""

import dataclasses
import time
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsub.estimate import Found, Problem, Rate, gauss_newton, scattered
from jaxsub.information import coloured_covariance
from jaxsub.simulation import Sampled, at_rest, measure, simulate

from . import setup
from .figures import coverages

Z95, SEED = 1.959964, 11
# disturbance forces in every equation: their time constant (s), and experiments by their size beside the rms of the
# equation's own forces
TIME, EXPERIMENTS = 3.0, {0.1: 40, 0.33: 60}


def run(out: Path, quick: bool) -> dict:
    """Coverage over repeated experiments on scenario II, raw and corrected."""
    vehicle = setup.truth()
    problem = setup.problem(vehicle, setup.recordings(2, 1))
    results = {"nominal": 0.95, "white": white_noise(problem, 40 if quick else 1000)}
    results["coloured"] = {
        f"{share:g}": disturbed(problem, 5 if quick else count, share) for share, count in EXPERIMENTS.items()
    }
    coverages(results, out / "coverage.png")
    return results


def white_noise(problem: Problem, count: int) -> dict:
    """Fits of `count` experiments with white noise of the catalogue's size, each from a start up to 30 % off."""
    clean = simulate(problem.vehicle, problem.runs, problem.guess)
    noise = np.random.default_rng(SEED).standard_normal((count, *clean.shape)) * np.asarray(problem.sigma)
    found = gauss_newton().run(problem, scattered(problem, 0.3, count, SEED), clean + jnp.asarray(noise))
    error, claimed = np.asarray(found.y - problem.coordinates()), np.asarray(_standard_errors(problem, found))
    names = [row.name for row in problem.vehicle.layout.free]
    inside, near = np.abs(error) < Z95 * claimed, np.abs(error) < 3.0 * claimed
    return {
        "experiments": count,
        "converged": Rate(int(np.sum(np.isfinite(np.asarray(found.cost)))), count).to_json(),
        "raw": _rate(inside),
        "within_3_standard_errors": _rate(near),
        "by_coefficient": dict(zip(names, inside.mean(0).tolist(), strict=True)),
    }


def disturbed(problem: Problem, count: int, share: float) -> dict:
    """The same with disturbance forces of that `share`: standard errors as for white residuals, and corrected."""
    rng = np.random.default_rng(SEED + 1)
    names = [row.name for row in problem.vehicle.layout.free]
    truth = np.array([float(problem.vehicle.values()[name]) for name in names])
    size, raw, corrected, spent = share * force_size(problem), [], [], []
    method, lost = gauss_newton(), 0
    for _ in range(count):
        force = gauss_markov(rng, problem, size)
        shown = _pushed(problem, jnp.asarray(force))
        noise = rng.standard_normal(shown.shape) * np.asarray(problem.sigma)
        start = scattered(problem, 0.3, 1, int(rng.integers(2**31)))
        runs = dataclasses.replace(problem.runs, outputs=shown + noise)
        own = dataclasses.replace(problem, runs=runs)
        found = method.run(own, start).one(0)
        if not np.isfinite(found.cost):
            lost += 1
            continue
        fit = setup.fitted(own, found)
        begin = time.perf_counter()
        error = np.abs(np.array(list(fit.values.values())) - truth)
        wide = np.array(list(coloured_covariance(fit).standard_errors.values()))
        spent.append(time.perf_counter() - begin)
        raw.append(error < Z95 * np.array(list(fit.standard_errors.values())))
        corrected.append(error < Z95 * wide)
    return {
        "experiments": count,
        "failed": lost,
        "disturbance": {"time_constant_s": TIME, "share_of_the_rms_force": share, "rms_by_equation": size.tolist()},
        "raw": _rate(np.array(raw)),
        "corrected": _rate(np.array(corrected)),
        "by_coefficient": dict(zip(names, np.mean(corrected, 0).tolist(), strict=True)),
        "seconds_a_correction": float(np.median(spent)),
    }


def _rate(inside: np.ndarray) -> dict:
    """The share inside; its interval from the scatter between experiments, whose coefficients err together."""
    shares = inside.mean(1)
    error = float(shares.std(ddof=1) / np.sqrt(len(shares)))
    mean = float(shares.mean())
    return {"observed": mean, "interval": [mean - 1.96 * error, min(1.0, mean + 1.96 * error)]}


@eqx.filter_jit
def _standard_errors(problem: Problem, found: Found) -> Float[Array, "n p"]:
    own = lambda y: jnp.sqrt(jnp.diag(jnp.linalg.inv(problem.expand(y).hessian)))
    return jax.lax.map(own, found.y, batch_size=8)


def force_size(problem: Problem) -> np.ndarray:
    """The rms of all that is not linear damping in each equation, over the undisturbed runs."""
    vehicle, runs = problem.vehicle, problem.runs
    states = Sampled.of(vehicle, runs).states(runs, at_rest(vehicle, len(runs.times)))
    force = np.asarray(vehicle.force(vehicle.motion(states, runs.signals)))
    # what is constant, as thrust is, disturbs nothing
    return np.maximum(force.std((0, 1)), 1e-6)


def gauss_markov(rng: np.random.Generator, problem: Problem, size: np.ndarray) -> np.ndarray:
    """(R, K, n) first-order Gauss–Markov forces of standard deviation `size`."""
    runs, samples = problem.runs.times.shape
    keep = np.exp(-setup.DT / TIME)
    force = np.empty((runs, samples, len(size)))
    force[:, 0] = rng.standard_normal((runs, len(size)))
    for k in range(1, samples):
        force[:, k] = keep * force[:, k - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal((runs, len(size)))
    return force * size


@eqx.filter_jit
def _pushed(problem: Problem, force: Float[Array, "r k n"]) -> Float[Array, "r k c"]:
    """What the sensors show, noise apart, when `force` acts besides."""
    vehicle, runs = problem.vehicle, problem.runs
    push = jnp.stack([force[:, :-1], force[:, 1:]], axis=2)
    return measure(vehicle, runs, Sampled.of(vehicle, runs).states(runs, problem.guess, push))
