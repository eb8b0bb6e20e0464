"""Samples for a filter from the readings of sensors: what drives it, what is measured, and what was wrong with them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.integrate import cumulative_trapezoid

from ..errors import InputError
from ..filter import Sample
from ..findings import Finding
from ..vehicle.sensors.earth import radii
from ..vehicle.sensors.water import depth_at
from .aided import AidedInputs
from .strapdown import Inertial
from .suite import Sensor, SensorSuite
from .suite.log import SensorLog, interpolated

# intervals between samples, and s, above which inertial readings are lost rather than sparse
_SPARSE, _LEAST_GAP = 5.0, 0.1
# s for which a motion that was not read goes on as it is, in reckoning what it may have become
_LASTING = 0.5
# standard deviations of the gyros' bias below which a smoothed rate shows no turn, and s over which it is smoothed
_TURNING, _SMOOTHED = 3.0, 1.0
# samples in a row at one and the same extreme that show a sensor at its stop, and the extreme's size in the usual ones
_STUCK, _FAR = 5, 4.0


@dataclasses.dataclass(frozen=True)
class Rows:
    """All rows of a log.

    **Fields**

    - `times`: (K,) s. `samples`: K of them. `findings`: what was wrong with the readings.
    - `used`: by sensor's name, how many measurements there are.
    - `rates`, `forces`: (K, 3) inertial readings at the rows, rad/s and m/s², body axes.
    """

    times: Float[np.ndarray, " k"]
    samples: Sample
    findings: tuple[Finding, ...]
    used: dict[str, int]
    rates: Float[np.ndarray, "k 3"]
    forces: Float[np.ndarray, "k 3"]


def rows_of(log: SensorLog, suite: SensorSuite) -> Rows:
    """The rows of a log: inertial readings in each, and measurements in the row nearest to when they were taken.

    Inertial readings of an interval are the means of those at its ends, or that at its end where a reading is a mean
    itself; where some are missing they are interpolated, and over longer gaps, or at a stop, they have a larger
    standard deviation. **Raises** `InputError` where fewer than two rows have inertial readings.
    """
    findings: list[Finding] = []
    gyro, accelerometer = suite.only("gyro"), suite.only("accelerometer")
    rates, rate, rate_std = _driving(log, gyro, findings)
    forces, force, force_std = _driving(log, accelerometer, findings)
    magnetometer = np.zeros_like(rate)
    outputs, masks, scales, used = [], [], [], {}
    straight = _without_turns(log, gyro, rates)
    for sensor in suite.aiding:
        values, scale = _measured(log, sensor, straight)
        mask = np.all(np.isfinite(values), axis=1)
        used[sensor.name] = int(mask.sum())
        if sensor.kind == "magnetometer":
            magnetometer = np.where(mask[:, None], values, 0.0)
            values = np.zeros((len(values), 1))
        outputs.append(np.where(mask[:, None], values, 0.0))
        masks.append(np.broadcast_to(mask[:, None], values.shape))
        scales.append(np.broadcast_to(scale[:, None], values.shape))
    elapsed = np.diff(log.times, prepend=log.times[0])
    for size, lasting in ((suite.motion.reach, suite.motion.reach_time), (suite.motion.speed, suite.motion.speed_time)):
        if np.isfinite(size):
            # an error that lasts for τ and is sampled every T is white noise of √(2τ/T) times its size
            scale = np.sqrt(np.maximum(2.0 * lasting / np.where(elapsed > 0.0, elapsed, np.inf), 1.0))
            outputs.append(np.zeros((len(elapsed), 3)))
            masks.append(np.ones((len(elapsed), 3), bool))
            scales.append(np.repeat(scale[:, None], 3, axis=1))
    findings += _gaps(log)
    joined = lambda parts, kind: np.concatenate(parts, axis=1) if parts else np.zeros((len(elapsed), 0), kind)
    rate, force, magnetometer, rate_std, force_std = map(jnp.asarray, (rate, force, magnetometer, rate_std, force_std))
    inputs = AidedInputs(Inertial(rate, force, magnetometer), rate_std, force_std)
    channels = (joined(outputs, float), joined(masks, bool), joined(scales, float))
    samples = Sample(inputs, jnp.asarray(elapsed), *map(jnp.asarray, channels))
    return Rows(log.times, samples, tuple(findings), used, rates, forces)


def sigmas(sensor: Sensor, origin: tuple[float, float] | None) -> np.ndarray:
    """Standard deviations of a sensor's channels as the filter has them: metres of latitude, depth of pressure."""
    sigma = np.array(sensor.sigma)
    if sensor.kind == "pressure":
        # of sea water to a part in a thousand
        return sigma * np.asarray(depth_at(np.full(1, 1e4), sensor.density or 1000.0, sensor.latitude)) / 1e4
    if "latitude" in sensor.channels and origin is not None:
        return np.concatenate([sigma[:2] * np.array(radii(origin[0])), sigma[2:]])
    return sigma


def _driving(log: SensorLog, sensor: Sensor, findings: list[Finding]) -> tuple[np.ndarray, ...]:
    """Readings (K, 3) at each row, over the interval before it, and by how much they may be wrong all through it."""
    read, times = log.readings[sensor.name], log.times
    good = np.all(np.isfinite(read), axis=1)
    if good.sum() < 2:
        raise InputError(log.source, f"has {good.sum()} samples of {sensor.name}", "give a log with at least two")
    whole = interpolated(times, times[good], read[good])
    usual = np.maximum(np.std(read[good], axis=0), 1e-3)
    stop = _at_stop(read, sensor)
    if stop.any():
        limit = f"its range of {sensor.range:g}" if np.isfinite(sensor.range) else "one extreme value in a row"
        what = f"{int(stop.any(axis=1).sum())} samples of {sensor.name} are at {limit}; the filter mistrusts them"
        remedy = "" if np.isfinite(sensor.range) else f"give range = … in sensors.{sensor.name}"
        findings.append(_finding("saturated", log, sensor, what, remedy, int(stop.any(axis=1).sum())))
    gap = _gap_lengths(times, good)
    if missing := int((~good).sum()):
        what = f"{missing} of {len(good)} samples of {sensor.name} are missing and interpolated"
        long = int(np.count_nonzero((gap > 0.0) & ~good))
        found = _finding("missing-samples", log, sensor, what, "", missing)
        if long:
            what = f"{what}; {long} of them in gaps of up to {gap.max():.3g} s, where the motion is unknown"
            found = dataclasses.replace(found, what=what)
        findings.append(found if long else dataclasses.replace(found, severity="note"))
    elapsed = np.diff(times, prepend=times[0])
    # over n intervals of T the errors add up to what one that lasts for τ makes of the gap
    lasting = np.sqrt(np.minimum(gap, _LASTING) / np.where(elapsed > 0.0, elapsed, 1.0))
    lost = (gap > 0.0)[:, None] * lasting[:, None] * usual
    stuck = np.where(stop, np.abs(np.nan_to_num(read)), 0.0)
    # a reading spoils the intervals on both of its sides
    stuck = np.maximum(stuck, np.concatenate([stuck[:1] * 0.0, stuck[:-1]]))
    mean = whole if sensor.sampling == "mean" else 0.5 * (whole + np.concatenate([whole[:1], whole[:-1]]))
    return whole, mean, np.maximum(lost, stuck)


def _at_stop(read: np.ndarray, sensor: Sensor) -> Bool[np.ndarray, "k 3"]:
    """Which readings are at their range, stated or shown by an extreme that several in a row have exactly."""
    if np.isfinite(sensor.range):
        return np.nan_to_num(np.abs(read)) >= sensor.range * (1.0 - 1e-9)
    stop = np.zeros(read.shape, bool)
    for axis, column in enumerate(read.T):
        good = column[np.isfinite(column)]
        centre = np.median(good)
        usual = np.median(np.abs(good - centre))
        for extreme in (good.min(), good.max()):
            at = column == extreme
            edges = np.flatnonzero(np.diff(np.concatenate([[False], at, [False]])))
            longest = int(np.max(edges[1::2] - edges[::2], initial=0))
            if longest >= _STUCK and abs(extreme - centre) > _FAR * usual > 0.0:
                stop[:, axis] |= at
    return stop


def _gap_lengths(times: np.ndarray, good: np.ndarray) -> np.ndarray:
    """(K,) s, length of the gap in good samples that the interval before each row lies in, zero where it is short."""
    at = np.flatnonzero(good)
    usual = float(np.median(np.diff(times[at])))
    after = np.clip(np.searchsorted(at, np.arange(len(times)), side="left"), 0, len(at) - 1)
    before = np.clip(after - 1, 0, None)
    length = times[at[after]] - times[at[before]]
    # before the first and after the last good one
    length = np.where(np.arange(len(times)) <= at[0], times[at[0]] - times[0], length)
    length = np.where(np.arange(len(times)) > at[-1], times[-1] - times[at[-1]], length)
    return np.where(length > max(_SPARSE * usual, _LEAST_GAP), length, 0.0)


def _without_turns(log: SensorLog, gyro: Sensor, rates: np.ndarray) -> np.ndarray:
    """(K,) s, length of the time about each row in which the vehicle does not turn; zero where it does."""
    assert gyro.noise is not None
    times = log.times
    turned = cumulative_trapezoid(np.linalg.norm(rates, axis=1), times, initial=0.0)
    first, last = (np.clip(times + sign * 0.5 * _SMOOTHED, times[0], times[-1]) for sign in (-1.0, 1.0))
    smoothed = (np.interp(last, times, turned) - np.interp(first, times, turned)) / np.maximum(last - first, 1e-9)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], smoothed < _TURNING * gyro.noise.bias, [False]])))
    length = np.zeros(len(times))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        length[begin:end] = times[end - 1] - times[begin]
    return length


def _measured(log: SensorLog, sensor: Sensor, straight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measurements (K, n) in the row nearest to when each was taken, and their noise in terms of the stated one.

    An error of a field's heading comes of the place and of what turns with the sensor: it lasts for as long as the
    vehicle goes `straight` (K,), s.
    """
    read, times = log.readings[sensor.name], log.times
    whole = np.flatnonzero(np.isfinite(read).all(axis=1))
    if sensor.rate > 0.0:
        whole = _thinned(whole, times, 1.0 / sensor.rate)
    taken = times[whole] - sensor.delay
    whole, taken = whole[taken >= times[0]], taken[taken >= times[0]]
    row = np.clip(np.searchsorted(times, taken), 1, len(times) - 1)
    row = row - (taken - times[row - 1] <= times[row] - taken)
    values = np.full(read.shape, np.nan)
    values[row] = read[whole]
    scale = np.ones(len(times))
    if sensor.correlation > 0.0 and len(row):
        between = np.diff(times[row], prepend=times[row[0]] - sensor.correlation)
        lasting = 2.0 * sensor.correlation
        if sensor.kind in ("magnetometer", "compass"):
            lasting = np.maximum(lasting, straight[row])
        scale[row] = np.sqrt(np.maximum(lasting / np.maximum(between, 1e-9), 1.0))
    return values, scale


def _thinned(whole: np.ndarray, times: np.ndarray, interval: float) -> np.ndarray:
    """Those of the rows `whole` that are at least about `interval` s apart: the first in each."""
    cell = np.floor((times[whole] - times[0]) / interval + 1e-6)
    return whole[np.unique(cell, return_index=True)[1]]


def _gaps(log: SensorLog) -> list[Finding]:
    """A warning where rows are far apart."""
    steps = np.diff(log.times)
    usual = float(np.median(steps))
    long = steps > max(10.0 * usual, 5.0 * _LEAST_GAP)
    if not long.any():
        return []
    at = np.flatnonzero(long)
    what = f"{at.size} gaps between rows, the longest {steps.max():.3g} s; what happened there is unknown"
    times = tuple((float(log.times[i]), float(log.times[i + 1])) for i in at[:10])
    return [Finding("time-gap", "warning", log.source, what, "", times=times, count=int(at.size))]


def _finding(check: str, log: SensorLog, sensor: Sensor, what: str, remedy: str, count: int) -> Finding:
    return Finding(check, "warning", log.source, what, remedy, channel=", ".join(sensor.columns), count=count)


def padded(samples: Sample, first: int, count: int, length: int) -> Sample:
    """`count` of the samples from number `first` on, as JAX's arrays of `length`; behind the last no time passes."""

    def part(leaf: Array) -> Array:
        own = np.asarray(leaf)[first : first + count]
        return jnp.asarray(np.concatenate([own, np.zeros((length - count, *own.shape[1:]), own.dtype)]))

    return jax.tree.map(part, samples)
