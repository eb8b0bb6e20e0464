"""What a rule made of an angle over many seeds, and the numbers by which rules are compared."""

from typing import NamedTuple

import numpy as np

from .bench import DEGREE, INTERVAL, TURN

STEADY = 160  # samples at the end of a run that count as steady: 40 s
BAND = (0.05, 1.0 * DEGREE)  # an estimate has settled within this share of the angle, or this angle
STAYS = 40  # samples for which it must stay there: with noise for ever would be never


class Runs(NamedTuple):
    """What one rule made of one angle, (seeds, samples)."""

    pitch: np.ndarray
    measured: np.ndarray
    known: np.ndarray
    nis: np.ndarray
    errors: np.ndarray
    deviations: np.ndarray
    noise: np.ndarray
    diverged: np.ndarray


def metrics(found: Runs, angle: float) -> dict[str, np.ndarray]:
    """Per seed: overshoot, %; settling time, s; steady rms and oscillation, degrees; mean steady error, degrees."""
    after = np.asarray(found.pitch)[:, TURN:]
    outside = np.abs(after - angle) > max(BAND[0] * angle, BAND[1])
    steady = after[:, -STEADY:] - angle
    slow = np.stack([np.convolve(row, np.ones(STAYS) / STAYS, mode="valid") for row in steady])
    middle = steady[:, STAYS // 2 : STAYS // 2 + slow.shape[1]]
    return {
        "overshoot_pct": 100.0 * np.maximum(np.max(after, axis=1) / angle - 1.0, 0.0),
        "settling_s": np.array([_settled(row) for row in outside]) * INTERVAL,
        "steady_rms_deg": np.sqrt(np.mean(steady**2, axis=1)) / DEGREE,
        "oscillation_deg": np.std(middle - slow, axis=1) / DEGREE,
        "steady_mean_deg": np.mean(steady, axis=1) / DEGREE,
    }


def _settled(outside: np.ndarray) -> int:
    """The first sample from which on the estimate stays inside; the length of the run if it never does."""
    inside = 0
    for index, out in enumerate(outside):
        inside = 0 if out else inside + 1
        if inside == STAYS:
            return index + 1 - STAYS
    return len(outside)
