"""Spectral peaks of the missing force: candidate frequencies of waves."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import fft

from .. import settings

_LINES = 4  # spectral lines between independent frequencies


def tones(
    force: Float[np.ndarray, "r k n"],
    times: Float[np.ndarray, "r k"],
    live: Bool[np.ndarray, "r k"],
    band: tuple[float, float],
) -> tuple[list[tuple[float, ...]], int]:
    """A few frequencies (rad/s) inside `band` for each of n forces of R runs, and how many there were to choose among.

    Those of the highest peaks of $|\\sum_r F_r(\\omega)|^2$ over its running median, F the Fourier transform by each
    run's own time.
    """
    from scipy import ndimage, signal

    longest = float(np.max(times[live], initial=0.0))
    interval = float(np.median(np.diff(times, axis=1)[live[:, 1:]]))
    grid = np.arange(0.0, longest + 0.5 * interval, interval)
    size = fft.next_fast_len(_LINES * len(grid), real=True) or 0
    whole = np.zeros((size // 2 + 1, force.shape[-1]), complex)
    for t, values, there in zip(times, force, live, strict=True):
        even = np.stack([np.interp(grid, t[there], column, right=0.0) for column in values[there].T], axis=1)
        whole += fft.rfft(even - even.mean(axis=0), size, axis=0)
    omega = 2.0 * np.pi * fft.rfftfreq(size, interval)
    inside = (omega >= band[0]) & (omega <= band[1])
    power = np.abs(whole) ** 2
    # so wide that the lines of all peaks are fewer than half of it
    width = 2 * _LINES * 2 * settings.MOST_EFFECTS + 1
    around = ndimage.median_filter(power, (width, 1), mode="nearest")
    height = (power / np.maximum(around, 1e-300))[inside]
    found = []
    for column in height.T:
        peaks, _ = signal.find_peaks(column, distance=_LINES + 2)
        best = peaks[np.argsort(-column[peaks])[: settings.MOST_EFFECTS]]
        found.append(tuple(float(w) for w in omega[inside][best]))
    return found, int(np.sum(inside)) // _LINES
