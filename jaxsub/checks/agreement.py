"""How a channel goes with the integral of the rate that kinematics gives it: factor, delay and drift."""

import dataclasses

import numpy as np

_LENGTHS = 12  # of windows, from one sample to an eighth of the run
_WINDOWS = 2000  # of one length
_FEWEST = 20  # samples
_INDEPENDENT = 8.0  # windows that do not overlap
_GOOD = 0.98  # correlation at which a shorter window is as good as a longer
_SIGNIFICANT = 20.0  # twice the log likelihood ratio of a delay
_TRIM = 6.0  # robust standard deviations of the residual
_ROBUST = 1.4826
_LAGS = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128], float)
_NARROW, _STEPS = 9, 6  # lags looked at about the best, and how often


@dataclasses.dataclass(frozen=True)
class Agreement:
    r"""The fit $\Delta P = k \int_{t}^{t+T} \dot P(\tau - d)\,d\tau + b\,T$ over windows of one length T.

    **Fields**

    - `correlation`: of both sides at the delay `delay` (s); positive `delay` means that the channel shows later what
      its rate shows now. It is 0 where a delay gains little.
    - `low`, `high`: the slopes of the regressions of either on the other, between which k is.
    - `windows`: how many do not overlap, on which all this rests.
    - `drift`: b in units of the channel a second, and `drift_error` its standard error; `rate`: rms of the rate about
      its mean.
    - `interval`: of the channel's samples, s.
    """

    correlation: float
    low: float
    high: float
    delay: float
    windows: float
    drift: float
    drift_error: float
    rate: float
    interval: float

    @property
    def factor(self) -> float:
        """k, the geometric mean of both slopes."""
        return float(np.sign(self.low) * np.sqrt(self.low * self.high))


@dataclasses.dataclass(frozen=True)
class _Pair:
    """The samples of a channel, and the integral of its rate on the rate's own samples."""

    times: np.ndarray
    values: np.ndarray
    rate_times: np.ndarray
    integral: np.ndarray
    holes: np.ndarray  # how many holes of the rate lie before each of its samples

    def increments(self, length: int, lag: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Change of the channel and of the integral `lag` s earlier over windows of `length` samples, and durations."""
        count = len(self.times) - length
        first = np.unique(np.linspace(0, count - 1, min(count, _WINDOWS)).astype(int))
        start, end = self.times[first] - lag, self.times[first + length] - lag
        inside = (start >= self.rate_times[0]) & (end <= self.rate_times[-1])
        at = lambda when: np.clip(np.searchsorted(self.rate_times, when), 0, len(self.holes) - 1)
        inside &= self.holes[at(start)] == self.holes[at(end)]
        first, start, end = first[inside], start[inside], end[inside]
        integral = np.interp(end, self.rate_times, self.integral) - np.interp(start, self.rate_times, self.integral)
        return self.values[first + length] - self.values[first], integral, end - start


@dataclasses.dataclass(frozen=True)
class _Line:
    """One regression of increments."""

    correlation: float
    low: float
    high: float
    intercept: float
    error: float
    windows: float
    duration: float


def agreement(times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> Agreement | None:
    """How `values` (samples,), NaN where missing, go with the integral of `rate` (samples,); None if that is not clear.

    Of windows of many lengths the shortest is taken over which both correlate by 0.98, else the one over which they
    correlate most. Where they do not correlate at once, a delay is sought at which they do, and taken if no other does
    nearly as well.
    """
    pair = _pair(times, values, rate)
    if pair is None:
        return None
    longest = len(pair.times) // 8
    lengths = np.unique(np.geomspace(1, max(longest, 1), _LENGTHS).astype(int))
    step = float(np.median(np.diff(pair.times)))
    best: tuple[float, int, float] | None = None
    for length in lengths.tolist():
        line = _line(pair, length, 0.0)
        if line and (best is None or abs(line.correlation) > best[0]):
            best = abs(line.correlation), length, 0.0
        if best and best[0] > _GOOD:
            break
    if best is None:
        return None
    if best[0] < 0.9:
        best = _sought(pair, lengths.tolist(), step) or best
    return _refined(pair, best[1], best[2], step, rate)


def _pair(times: np.ndarray, values: np.ndarray, rate: np.ndarray) -> _Pair | None:
    there, known = np.isfinite(values), np.isfinite(rate)
    if np.count_nonzero(there) < _FEWEST or np.count_nonzero(known) < _FEWEST:
        return None
    at, rates = times[known], rate[known]
    steps = np.diff(at)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * steps)])
    holes = np.concatenate([[0], np.cumsum(steps > 5.0 * np.median(steps))])
    return _Pair(times[there], values[there], at, integral, holes)


def _line(pair: _Pair, length: int, lag: float) -> _Line | None:
    """The regression over windows of `length` samples; None where too few are independent or one side is at rest."""
    change, integral, durations = pair.increments(length, lag)
    if change.size < _FEWEST:
        return None
    duration = float(np.median(durations))
    covered = min(float(pair.times[-1] - pair.times[0]), change.size * duration)
    windows = covered / duration
    spread = float(np.std(change)), float(np.std(integral))
    if windows < _INDEPENDENT or min(spread) <= 0.0:
        return None
    # outliers with respect to the line along which both vary most
    sign = np.sign(np.sum((change - change.mean()) * (integral - integral.mean()))) or 1.0
    apart = change / spread[0] - sign * integral / spread[1]
    apart -= np.median(apart)
    kept = np.abs(apart) <= _TRIM * max(_ROBUST * float(np.median(np.abs(apart))), 1e-9)
    change, integral, durations = change[kept], integral[kept], durations[kept]
    covariance = np.cov(change, integral)
    if min(covariance[0, 0], covariance[1, 1]) <= 0.0 or change.size < _FEWEST:
        return None
    correlation = float(covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1]))
    ratio = float(np.sqrt(covariance[0, 0] / covariance[1, 1]))
    low, high = correlation * ratio, ratio / correlation if correlation else np.inf
    slope = np.sign(correlation) * ratio
    rest = (change - slope * integral) / duration
    return _Line(correlation, low, high, float(rest.mean()), float(rest.std() / np.sqrt(windows)), windows, duration)


def _sought(pair: _Pair, lengths: list[int], step: float) -> tuple[float, int, float] | None:
    """The window and delay at which both sides correlate by 0.95, if they do not nearly so at any other."""
    furthest = 0.1 * float(pair.times[-1] - pair.times[0])
    lags = step * np.concatenate([-_LAGS[::-1], _LAGS])
    lags = lags[np.abs(lags) <= furthest]
    best: tuple[float, int, float] | None = None
    for length in lengths:
        lines = [_line(pair, length, lag) for lag in lags.tolist()]
        sizes = np.array([line.correlation if line and line.windows > 2.5 * _INDEPENDENT else 0.0 for line in lines])
        if not sizes.size:
            continue
        at = int(np.argmax(np.abs(sizes)))
        others = np.abs(lags - lags[at]) > max(length * step, 0.3 * abs(lags[at]))
        rival = float(np.max(np.abs(sizes[others]), initial=0.0))
        if abs(sizes[at]) > max(0.9, rival + 0.1) and (best is None or abs(sizes[at]) > best[0]):
            best = float(abs(sizes[at])), length, float(lags[at])
    return best


def _refined(pair: _Pair, length: int, lag: float, step: float, rate: np.ndarray) -> Agreement | None:
    """The agreement at the delay about `lag` where both sides correlate most."""
    without, centre = _line(pair, length, 0.0), _line(pair, length, lag)
    if centre is None:
        return None
    sign = 1.0 if centre.correlation >= 0.0 else -1.0
    furthest = 0.1 * float(pair.times[-1] - pair.times[0])
    width = max(4.0 * step, 0.5 * abs(lag))
    for _ in range(_STEPS):
        lags = lag + width * np.linspace(-1.0, 1.0, _NARROW)
        lines = [(sign * line.correlation, one, line) for one in lags.tolist() if (line := _line(pair, length, one))]
        if not lines:
            return None
        top = max(lines, key=lambda entry: entry[0])
        # the best at an end: it lies further that way
        width = 1.5 * width if top[1] in (lags[0], lags[-1]) and abs(top[1]) < furthest else width / 3.0
        centre, lag = top[2], top[1]
    # a signal that grows or swings regularly looks alike at many delays: one is believed where it gains much
    if (without is not None and _gain(without, centre) < _SIGNIFICANT) or abs(lag) <= 1.5 * step:
        centre, lag = without or centre, 0.0
    known = rate[np.isfinite(rate)]
    low, high = sorted((centre.low, centre.high), key=abs)
    told = (centre.intercept, centre.error, float(np.std(known)), step)
    return Agreement(centre.correlation, low, high, lag, centre.windows, *told)


def _gain(without: _Line, line: _Line) -> float:
    """Twice the log likelihood ratio of a line with a delay to that without."""
    better = (1.0 - without.correlation**2) / max(1.0 - line.correlation**2, 1e-12)
    return without.windows * float(np.log(max(better, 1e-12)))
