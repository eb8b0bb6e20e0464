"""How real logs differ from samples of white noise of a stated size: what is done to clean measurements, by name."""

from collections.abc import Callable

import numpy as np

from .bodies import INTERVAL

Samples = np.ndarray
# standard deviations of an outlier, and what share of the samples is one
OUTLIER_SIGMAS, OUTLIERS = 20.0, 0.1
DROP_OUT_SECONDS, SLOW_SECONDS, KEPT = 20.0, 1.0, 0.5
QUANTUM_SIGMAS = 4.0
# least and most of a noise that changes over a run, of its standard deviation
QUIET, LOUD = 0.5, 3.0


def white(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """Samples (R, K, c) of perfect sensors with white noise of `sigma` (c,)."""
    return ideal + sigma * rng.standard_normal(ideal.shape)


def _varying(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """Noise whose size swings between `QUIET` and `LOUD`, three times a run."""
    swing = 0.5 - 0.5 * np.cos(2.0 * np.pi * 3.0 * np.linspace(0.0, 1.0, ideal.shape[1]))
    factor = QUIET + (LOUD - QUIET) * swing
    return white(ideal, factor[:, None] * sigma, rng)


def _outliers(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """A tenth of all samples elsewhere."""
    away = OUTLIER_SIGMAS * rng.uniform(-1.0, 1.0, ideal.shape) * (rng.random(ideal.shape) < OUTLIERS)
    return white(ideal, sigma, rng) + sigma * away


def _dropout(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """One sensor of each run is silent for some seconds."""
    measured, count = white(ideal, sigma, rng), round(DROP_OUT_SECONDS / INTERVAL)
    for run in measured:
        first = int(rng.integers(len(run) - count))
        run[first : first + count, rng.integers(run.shape[1])] = np.nan
    return measured


def _slow(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """Sensors once a second, commands as often as before."""
    there = np.arange(ideal.shape[1]) % round(SLOW_SECONDS / INTERVAL) == 0
    return np.where(there[:, None], white(ideal, sigma, rng), np.nan)


def _uneven(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """Half of the samples of all sensors are lost."""
    there = rng.random(ideal.shape[:2]) < KEPT
    return np.where(there[..., None], white(ideal, sigma, rng), np.nan)


def _quantised(ideal: Samples, sigma: np.ndarray, rng: np.random.Generator) -> Samples:
    """Numbers of so few digits that the noise is less than a step."""
    step = QUANTUM_SIGMAS * sigma
    return step * np.round(white(ideal, sigma, rng) / step)


LOGGED: dict[str, Callable[[Samples, np.ndarray, np.random.Generator], Samples]] = {
    "varying_noise": _varying, "outliers": _outliers, "dropout": _dropout, "slow": _slow, "uneven": _uneven,
    "quantised": _quantised,
}  # fmt: skip
