"""Whether a filter knows how wrong it is: its normalised innovations and errors squared against their bounds."""

from collections.abc import Mapping

import numpy as np
from scipy.stats import chi2

from .pitch_runs import STEADY, Runs

_CHANNELS = 3
_BIASES = slice(-3, None)


def consistency(found: Mapping[str, Runs]) -> dict:
    """For each set of runs: NIS averaged over seeds at each fix, and NEES a state, in the last 40 s."""
    return {name: _of(runs) for name, runs in found.items()}


def _of(runs: Runs) -> dict:
    seeds = len(runs.nis)
    low, high = (float(chi2.ppf(p, _CHANNELS * seeds)) / seeds for p in (0.025, 0.975))
    steady = runs.nis[:, -STEADY:]
    averaged = np.mean(steady[:, np.all(np.isfinite(steady), axis=0)], axis=0)
    normalised = (runs.errors[:, -STEADY:, _BIASES] / runs.deviations[:, -STEADY:, _BIASES]) ** 2
    bias = np.mean(normalised, axis=(0, 2))
    bounds = [float(chi2.ppf(p, 3 * seeds)) / (3 * seeds) for p in (0.025, 0.975)]
    return {
        "nis": float(np.mean(averaged)),
        "nis_band": [low, high],
        "nis_inside": float(np.mean((averaged >= low) & (averaged <= high))),
        "nees_bias": float(np.mean(bias)),
        "nees_bias_band": bounds,
        "nees_bias_inside": float(np.mean((bias >= bounds[0]) & (bias <= bounds[1]))),
    }
