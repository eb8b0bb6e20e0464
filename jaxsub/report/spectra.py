r"""Power spectral densities of residuals by Welch's method, of series with missing samples.

$S(f) = \frac{2\Delta}{\sum_k w_k^2 m_k}\left|\sum_k w_k m_k (e_k - \bar e)\,\mathrm e^{-2\pi i f k\Delta}\right|^2$
over segments that overlap by half, with Hann windows $w$; $m$ is 1 where a sample was measured and 0 elsewhere.
Sources: Welch (1967), IEEE Trans. Audio Electroacoust. 15; Parzen (1963), Sankhyā A 25, for missing samples.
"""

import numpy as np
from jaxtyping import Float

_SEGMENTS = 4  # that fit into a run side by side; with those between them 7 are averaged
_LEAST = 32  # samples without which there is no spectrum
_LONGEST = 1 << 18  # samples of the even grid: a run with bursts has more places than samples
_LEAST_MEASURED = 0.5  # of a segment's window


def spectrum(
    times: Float[np.ndarray, " k"], values: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " f"], Float[np.ndarray, " f"]]:
    """Frequencies (Hz) and one-sided power spectral density (unit²/Hz) of `values` at `times` (s); NaN is missing.

    Both are empty where fewer than 32 samples were measured. Samples are put on the nearest place of an even grid.
    """
    measured = np.isfinite(values)
    nothing = np.empty(0), np.empty(0)
    if measured.sum() < _LEAST:
        return nothing
    at, series = times[measured] - times[measured][0], values[measured]
    interval = max(float(np.median(np.diff(at))), float(at[-1]) / _LONGEST)
    places = np.round(at / interval).astype(int)
    grid, there = np.zeros(places[-1] + 1), np.zeros(places[-1] + 1)
    grid[places], there[places] = series, 1.0
    length = 2 * (len(grid) // (2 * _SEGMENTS))
    window = np.hanning(length + 1)[:-1]
    segments = [np.lib.stride_tricks.sliding_window_view(of, length)[:: length // 2] for of in (grid, there)]
    weight = np.sum(window**2 * segments[1], axis=1)
    kept = weight > _LEAST_MEASURED * np.sum(window**2)
    if not kept.any():
        return nothing
    part, mask = segments[0][kept], segments[1][kept]
    centred = mask * (part - np.sum(mask * part, axis=1, keepdims=True) / mask.sum(axis=1, keepdims=True))
    power = 2.0 * interval * np.abs(np.fft.rfft(window * centred)) ** 2 / weight[kept, None]
    # neither the mean nor the Nyquist frequency, which are not twofold
    return np.fft.rfftfreq(length, interval)[1:-1], np.mean(power, axis=0)[1:-1]
