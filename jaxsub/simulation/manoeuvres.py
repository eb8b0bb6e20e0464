"""Inputs that shake a vehicle: standard manoeuvres as functions of time, and a random telegraph signal."""

from collections.abc import Sequence

import numpy as np


def square(times: np.ndarray, period: float, amplitude: float) -> np.ndarray:
    """A square wave, (samples,) at `times` in s: `amplitude` for half a `period` (s), then minus that: a zigzag."""
    return amplitude * np.where((times - times[0]) % period < 0.5 * period, 1.0, -1.0)


def doublet(times: np.ndarray, start: float, width: float, amplitude: float) -> np.ndarray:
    """`amplitude` for `width` s from `start` (s), as long the other way, else zero, (samples,) at `times` in s."""
    return _pulses(times, start, (width, width), amplitude)


def three_two_one_one(times: np.ndarray, start: float, unit: float, amplitude: float) -> np.ndarray:
    """Pulses of ± `amplitude`, of 3, 2, 1 and 1 `unit` (s) from the time `start` (s), else zero.

    (samples,) at `times` in s. Its power is distributed over a decade of frequency.
    Source: Mulder et al. (1994), AGARD-AG-300 vol. 3.
    """
    return _pulses(times, start, (3 * unit, 2 * unit, unit, unit), amplitude)


def prbs(samples: int, hold: int, amplitude: float, seed: int) -> np.ndarray:
    """A random telegraph signal, (samples,): plus or minus `amplitude`, drawn anew after every `hold` samples.

    `samples` is its length. Equal `seed`s give equal signals.
    """
    signs = np.random.default_rng(seed).choice((-1.0, 1.0), -(-samples // hold))
    return amplitude * np.repeat(signs, hold)[:samples]


def _pulses(times: np.ndarray, start: float, widths: Sequence[float], amplitude: float) -> np.ndarray:
    edges = start + np.concatenate([[0.0], np.cumsum(widths)])
    # a sample that rounding puts just before an edge belongs to the pulse that begins there
    pulse = np.searchsorted(edges, times + 1e-9 * max(widths), side="right")
    inside = (pulse > 0) & (pulse < len(edges))
    return amplitude * np.where(inside, np.where(pulse % 2 == 1, 1.0, -1.0), 0.0)
