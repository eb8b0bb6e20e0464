"""How far the changes of a channel are from the integral of the rate that kinematics gives it."""

import dataclasses

import numpy as np

_LENGTHS = 7  # of windows, from one sample to a sixth of the run
_WINDOWS = 400  # of one length
_FEWEST = 20  # samples, and windows
_TRIMMED = 0.02  # of the windows, whose differences are largest: steps of a receiver, what spikes are left
_PASSES = 12  # of coordinate descent
_DRIFT = 0.3  # of the rms of the rate: the mean by which a rate may be off
_NOISE = 0.15  # share of white noise in the variance of a side, beyond which a length says nothing
_HOLE = 5.0  # times the interval that nine of ten samples of a channel have at most


@dataclasses.dataclass(frozen=True)
class Comparison:
    r"""$\Delta P$ beside $\int\dot P\,dt$ over windows of several lengths.

    Their distance is one less Lin's concordance correlation coefficient, about zero and not their means:
    $D = \langle e^2\rangle / (\langle\Delta P^2\rangle + \langle(\int\dot P)^2\rangle)$, which is 0 where both are
    equal, 1 where they have nothing in common and more where they are opposite.

    **Fields**, (lengths,) each, NaN where a length has too few windows

    - `distances`: D. `residuals`: mean of e². `independent`: how many of e are independent by their autocorrelation.
    - `changes`, `integrals`: rms of both sides, unit of the channel. `durations`: median length of a window, s.
    - `clear`: whether white noise, as second differences of samples show it, is a small share of either side.
    - `drifts`, `drift_errors`: mean of e over time and its standard error, unit of the channel a second.
    """

    distances: np.ndarray
    residuals: np.ndarray
    independent: np.ndarray
    changes: np.ndarray
    integrals: np.ndarray
    durations: np.ndarray
    clear: np.ndarray
    drifts: np.ndarray
    drift_errors: np.ndarray

    @property
    def distance(self) -> float:
        """The least D of all lengths that are clear, infinite where none is."""
        return float(np.nanmin(np.where(self.clear, self.distances, np.inf)))


@dataclasses.dataclass(frozen=True)
class Windows:
    """First and last rows (windows,) of windows of several lengths, in each of which the rate is known throughout."""

    ends: tuple[tuple[np.ndarray, np.ndarray], ...]

    @classmethod
    def of(cls, times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> "Windows":
        """The windows between samples of `values` (samples,), NaN where missing, from one sample to a sixth of all."""
        known = np.flatnonzero(np.isfinite(rate))
        rows = np.flatnonzero(np.isfinite(values) & np.isfinite(rate))
        if rows.size < _FEWEST:
            return cls(())
        steps = np.diff(times[known])
        stretch = np.zeros(times.shape, int)
        stretch[known[1:]] = np.cumsum((np.diff(known) > 1) | (steps > longest_step(times[known])))
        ends = []
        for length in np.unique(np.geomspace(1, max(rows.size // 6, 1), _LENGTHS).astype(int)).tolist():
            first = np.unique(np.linspace(0, rows.size - length - 1, min(rows.size - length, _WINDOWS)).astype(int))
            a, b = rows[first], rows[first + length]
            whole = stretch[a] == stretch[b]
            if np.count_nonzero(whole) >= _FEWEST:
                ends.append((a[whole], b[whole]))
        return cls(tuple(ends))

    @property
    def few(self) -> "Windows":
        """Those of every other length."""
        return Windows(self.ends[1::2])


def compared(
    times: np.ndarray,
    values: np.ndarray,
    rate: np.ndarray,
    windows: Windows,
    arms: np.ndarray | None = None,
    reach: float = 0.0,
    offset: float = 0.0,
) -> Comparison | None:
    """Compare `values` (samples,), NaN where missing, with the integral of `rate` (samples,); None without windows.

    `arms` (arms, samples) times a number of up to `reach` each, a lever arm or an angle of mounting, may be added to
    `values`, and a mean of up to `offset` or 0.3 times the rms of the rate to `rate`.
    """
    if not windows.ends:
        return None
    integral = integrated(times, rate)
    known = np.isfinite(values) & np.isfinite(rate)
    found = np.full((8, len(windows.ends)), np.nan)
    noises = white(times, values), white(times, rate) * float(np.median(np.diff(times)))
    for column, (a, b) in enumerate(windows.ends):
        if not known.all():
            whole = known[a] & known[b]
            a, b = a[whole], b[whole]
        if a.size >= _FEWEST:
            turned = None if arms is None else arms[:, b] - arms[:, a]
            sides = values[b] - values[a], integral[b] - integral[a]
            found[:, column] = _window(*sides, times[b] - times[a], turned, reach, offset)
    distances, residuals, independent, changes, integrals, durations, *drifts = found
    with np.errstate(invalid="ignore"):
        clear = (2.0 * noises[0] < _NOISE * changes**2) & (durations * noises[1] < _NOISE * integrals**2)
    return (
        Comparison(distances, residuals, independent, changes, integrals, durations, clear, *drifts)
        if found.size
        else None
    )


def integrated(times: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """The integrals of `rates` (..., samples) over time from the first sample, zero where a rate is missing."""
    levels = np.nan_to_num(rates)
    steps = 0.5 * (levels[..., 1:] + levels[..., :-1]) * np.diff(times)
    return np.concatenate([np.zeros((*levels.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def longest_step(times: np.ndarray) -> float:
    """The interval (s) between samples at `times` (n,) beyond which there is a hole between them."""
    return _HOLE * float(np.percentile(np.diff(times), 90.0))


def white(times: np.ndarray, values: np.ndarray) -> float:
    """The variance of the white noise of samples (n,), NaN where missing, from second differences within no hole."""
    there = np.isfinite(values)
    second, times = np.diff(values[there], 2), times[there]
    if not second.size:
        return np.inf
    whole = np.diff(times) <= longest_step(times)
    second = second[whole[1:] & whole[:-1]]
    return float(np.mean(second**2)) / 6.0 if second.size else np.inf


def _window(
    change: np.ndarray, integral: np.ndarray, duration: np.ndarray, arms: np.ndarray | None, reach: float, offset: float
) -> tuple[float, ...]:
    """The entries of a `Comparison` for one length of windows."""
    count = change.size
    difference = change - integral
    sizes = float(np.sqrt(change @ change / count)), float(np.sqrt(integral @ integral / count))
    mean = float(duration.sum() / count)
    if not any(sizes):
        return (np.nan,) * 8
    slack = max(offset, _DRIFT * min(sizes) / mean)
    if arms is None:
        drift = float(duration @ difference) / float(duration @ duration)
        rest, armed = difference - min(max(drift, -slack), slack) * duration, np.zeros(count)
    else:
        limits = np.array([slack, *[reach] * len(arms)])
        numbers = _within(np.vstack([duration, arms]), difference, limits)
        armed = numbers[1:] @ arms
        rest = difference - numbers[0] * duration - armed
    # of everything alike, so that a short manoeuvre in a long rest counts
    size = np.abs(rest)
    kept = size <= np.partition(size, at := int((1.0 - _TRIMMED) * (count - 1)))[at]
    change, integral = change[kept], integral[kept]
    squares = float(np.sum(rest[kept] ** 2))
    # what an arm accounts for says nothing of agreement
    whole = float(change @ change + integral @ integral - armed[kept] @ armed[kept])
    independent = _independent(rest[kept])
    drift = float(np.mean(difference[kept])) / mean
    error = float(np.sqrt(squares / count / independent)) / mean
    residual = max(squares / count, 1e-300)
    return max(squares / max(whole, squares, 1e-300), 1e-12), residual, independent, *sizes, mean, drift, error


def _within(columns: np.ndarray, values: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """The numbers (n,) within `limits` (n,) of the combination of `columns` (n, samples) nearest to `values`."""
    gram, target = columns @ columns.T, columns @ values
    numbers = np.zeros(len(columns))
    for _ in range(_PASSES):
        for i in range(len(columns)):
            if gram[i, i] > 0.0:
                step = (target[i] - gram[i] @ numbers) / gram[i, i]
                numbers[i] = min(max(numbers[i] + step, -limits[i]), limits[i])
    return numbers


def _independent(values: np.ndarray) -> float:
    """How many of the `values` (n,) count as independent, by their autocorrelation up to its first zero."""
    about = values - values.mean()
    spectrum = np.fft.rfft(about, 2 << (about.size - 1).bit_length())
    power = spectrum.real**2 + spectrum.imag**2
    correlation = np.fft.irfft(power)[: about.size]
    if correlation[0] <= 0.0:
        return float(values.size)
    correlation = correlation / correlation[0]
    negative = np.flatnonzero(correlation <= 0.0)
    until = int(negative[0]) if negative.size else correlation.size
    return values.size / float(2.0 * np.sum(correlation[:until]) - 1.0)


def filled(times: np.ndarray, values: np.ndarray, angle: bool) -> np.ndarray:
    """`values` (samples,) interpolated over missing samples, but not across holes of the channel, nor at its ends."""
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size < 2:
        return values
    there = np.unwrap(values[rows]) if angle else values[rows]
    whole = np.interp(times, times[rows], there, left=np.nan, right=np.nan)
    for hole in np.flatnonzero(np.diff(times[rows]) > longest_step(times[rows])):
        whole[rows[hole] + 1 : rows[hole + 1]] = np.nan
    return whole
