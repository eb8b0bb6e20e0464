"""How far the changes of a channel are from the integral of the rate that kinematics gives it."""

import dataclasses
from collections.abc import Callable, Sequence

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
    equal; it is taken as 1 at most, where they have nothing in common or are opposite.

    **Fields**, (..., lengths) each, NaN where a length has too few windows

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
    def distance(self) -> np.ndarray:
        """The least D (...,) of all lengths that are clear, infinite where none is."""
        return np.asarray(np.min(np.where(self.clear, self.distances, np.inf), axis=-1))

    def __getitem__(self, row: int) -> "Comparison":
        """One (lengths,) of several comparisons (several, lengths)."""
        return self._with(lambda field: field[row])

    def repeated(self, count: int) -> "Comparison":
        """`count` comparisons (count, lengths), where all of them may be one."""
        return self._with(lambda field: np.broadcast_to(field, (count, field.shape[-1])))

    def _with(self, change: Callable[[np.ndarray], np.ndarray]) -> "Comparison":
        return Comparison(*(change(getattr(self, field.name)) for field in dataclasses.fields(self)))


@dataclasses.dataclass(frozen=True)
class Windows:
    """First and last rows of windows of several lengths, in each of which the rate is known throughout.

    **Fields**, (lengths, windows) each but `holes`

    - `first`, `last`: rows. `there`: whether a length has that window; the others fill up.
    - `holes`: the step between samples of the channel, and of its rate, beyond which there is a hole, s.
    """

    first: np.ndarray
    last: np.ndarray
    there: np.ndarray
    holes: tuple[float, float]

    @classmethod
    def of(cls, times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> "Windows":
        """The windows between samples of `values` (samples,), NaN where missing, from one sample to a sixth of all."""
        known, sampled = np.flatnonzero(np.isfinite(rate)), np.isfinite(values)
        rows = np.flatnonzero(sampled & np.isfinite(rate))
        ends, holes = [], (np.inf, np.inf)
        if rows.size >= _FEWEST:
            holes = longest_step(times[sampled]), longest_step(times[known])
            stretch = np.zeros(times.shape, int)
            stretch[known[1:]] = np.cumsum((np.diff(known) > 1) | (np.diff(times[known]) > holes[1]))
            for length in np.unique(np.geomspace(1, max(rows.size // 6, 1), _LENGTHS).astype(int)).tolist():
                first = np.unique(np.linspace(0, rows.size - length - 1, min(rows.size - length, _WINDOWS)).astype(int))
                a, b = rows[first], rows[first + length]
                whole = stretch[a] == stretch[b]
                if np.count_nonzero(whole) >= _FEWEST:
                    ends.append((a[whole], b[whole]))
        sizes = np.array([a.size for a, _ in ends], int)
        there = np.arange(max(sizes, default=0)) < sizes[:, None]
        first, last = np.zeros((2, *there.shape), int)
        if ends:
            first[there], last[there] = np.concatenate(ends, axis=1)
        return cls(first, last, there, holes)

    @property
    def few(self) -> "Windows":
        """Those of every other length."""
        return Windows(self.first[1::2], self.last[1::2], self.there[1::2], self.holes)


def compared(
    times: np.ndarray,
    values: np.ndarray,
    rate: np.ndarray,
    windows: Windows,
    arms: Sequence[np.ndarray] = (),
    reach: float = 0.0,
    offset: float = 0.0,
) -> Comparison | None:
    """Compare `values` (..., samples), NaN where missing, with the integral of `rate` (..., samples).

    Each of `arms` (..., samples) times a number of up to `reach`, a lever arm or an angle of mounting, may be added to
    `values`, and a mean of up to `offset` or 0.3 times the rms of the rate to `rate`. None without windows.
    """
    if not windows.there.size:
        return None
    known = np.isfinite(values) & np.isfinite(rate)
    used = windows.there & np.take(known, windows.first, -1) & np.take(known, windows.last, -1)
    interval = float(np.median(np.diff(times)))
    noises = white(times, values, windows.holes[0]), interval * white(times, rate, windows.holes[1])
    # windows that are not used count as zero, and lengths of too few are NaN
    with np.errstate(invalid="ignore", divide="ignore"):
        change, integral, duration, *turned = (
            np.where(used, np.take(samples, windows.last, -1) - np.take(samples, windows.first, -1), 0.0)
            for samples in (values, integrated(times, rate), times, *arms)
        )
        distances, residuals, independent, changes, integrals, durations, drifts, errors = _of_windows(
            used, change, integral, duration, turned, reach, offset
        )
        clear = (2.0 * noises[0] < _NOISE * changes**2) & (durations * noises[1] < _NOISE * integrals**2)
    return Comparison(distances, residuals, independent, changes, integrals, durations, clear, drifts, errors)


def integrated(times: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """The integrals of `rates` (..., samples) over time from the first sample, zero where a rate is missing."""
    levels = np.where(np.isfinite(rates), rates, 0.0)
    steps = 0.5 * (levels[..., 1:] + levels[..., :-1]) * np.diff(times)
    return np.concatenate([np.zeros((*levels.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def longest_step(times: np.ndarray) -> float:
    """The interval (s) between samples at `times` (n,) beyond which there is a hole between them."""
    return _HOLE * float(np.percentile(np.diff(times), 90.0))


def white(times: np.ndarray, values: np.ndarray, hole: float) -> np.ndarray:
    """The variance (..., 1) of the white noise of samples (..., n), NaN where missing, at `times` (n,).

    It is that of second differences over no step longer than `hole` (s), infinite where there are none.
    """
    there = np.isfinite(values)
    (series, clock), inside = _closed(np.broadcast_arrays(values, times), there)
    whole = inside[..., 1:] & (np.diff(clock) <= hole)
    whole = whole[..., 1:] & whole[..., :-1]
    second = np.where(whole, np.diff(series, 2), 0.0)
    count = np.count_nonzero(whole, axis=-1)
    return np.where(count, _dot(second, second) / np.maximum(count, 1) / 6.0, np.inf)[..., None]


def _closed(several: Sequence[np.ndarray], kept: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Values (..., n), those that are not `kept` taken out and zeros behind the last, and which of them are inside."""
    inside = np.arange(kept.shape[-1]) < np.count_nonzero(kept, axis=-1)[..., None]
    found = [np.zeros(kept.shape) for _ in several]
    for values, closed in zip(several, found, strict=True):
        closed[inside] = values[kept]
    return found, inside


def _of_windows(
    used: np.ndarray,
    change: np.ndarray,
    integral: np.ndarray,
    duration: np.ndarray,
    arms: Sequence[np.ndarray],
    reach: float,
    offset: float,
) -> np.ndarray:
    """The fields but `clear` of a `Comparison`, (8, ..., lengths), of what differs over windows (..., windows)."""
    count = np.count_nonzero(used, axis=-1)
    sizes = np.sqrt([_dot(side, side) / count for side in (change, integral)])
    mean = np.sum(duration, axis=-1) / count
    slack = np.maximum(offset, _DRIFT * np.min(sizes, axis=0) / mean)
    limits = np.stack([slack, *[np.full(slack.shape, reach)] * len(arms)], axis=-1)
    difference, columns = change - integral, np.stack([duration, *arms], axis=-2)
    numbers = _within(columns, difference, limits)[..., None]
    armed = np.sum(numbers[..., 1:, :] * columns[..., 1:, :], axis=-2)
    rest = difference - numbers[..., 0, :] * duration - armed
    # of everything alike, so that a short manoeuvre in a long rest counts
    size = np.where(used, np.abs(rest), np.inf)
    most = np.maximum((1.0 - _TRIMMED) * (count - 1), 0.0).astype(int)[..., None]
    kept = used & (size <= np.take_along_axis(np.sort(size, axis=-1), most, axis=-1))
    change, integral, difference, rest, armed = np.where(kept, [change, integral, difference, rest, armed], 0.0)
    squares = _dot(rest, rest)
    # what an arm accounts for says nothing of agreement
    whole = _dot(change, change) + _dot(integral, integral) - _dot(armed, armed)
    distance = np.maximum(squares / np.maximum(np.maximum(whole, squares), 1e-300), 1e-12)
    independent = _independent(rest, kept)
    drift = np.sum(difference, axis=-1) / np.count_nonzero(kept, axis=-1) / mean
    error = np.sqrt(squares / count / independent) / mean
    fields = [distance, np.maximum(squares / count, 1e-300), independent, *sizes, mean, drift, error]
    return np.where((count >= _FEWEST) & sizes.any(axis=0), fields, np.nan)


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.asarray(np.einsum("...w,...w->...", one, other))


def _within(columns: np.ndarray, values: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """The numbers (..., n) within `limits` of the combination of `columns` (..., n, samples) nearest to `values`."""
    gram, off = columns @ np.swapaxes(columns, -1, -2), _dot(columns, values[..., None, :])
    squares = np.einsum("...nn->...n", gram)
    squares = np.where(squares > 0.0, squares, 1.0)
    numbers = np.zeros(limits.shape)
    for _ in range(_PASSES):
        before = numbers.copy()
        for i in range(limits.shape[-1]):
            nearest = numbers[..., i] + off[..., i] / squares[..., i]
            nearest = np.minimum(np.maximum(nearest, -limits[..., i]), limits[..., i])
            off -= gram[..., i] * (nearest - numbers[..., i])[..., None]
            numbers[..., i] = nearest
        if np.array_equal(numbers, before):
            break
    return numbers


def _independent(values: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """How many (...,) of the `values` (..., n) that are `kept` are independent, by their autocorrelation.

    It counts up to its first zero. Values that are not kept are zero, and those about them are taken as neighbours.
    """
    count = np.count_nonzero(kept, axis=-1)
    about = values - (np.sum(values, axis=-1) / count)[..., None]
    (about,), inside = _closed([about], kept)
    spectrum = np.fft.rfft(about, 2 << (kept.shape[-1] - 1).bit_length())
    correlation = np.fft.irfft(spectrum.real**2 + spectrum.imag**2)[..., : kept.shape[-1]]
    first, positive = correlation[..., 0], np.logical_and.accumulate(inside & (correlation > 0.0), axis=-1)
    times = 2.0 * np.sum(correlation, axis=-1, where=positive) / first - 1.0
    return count / np.where(first > 0.0, times, 1.0)


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
