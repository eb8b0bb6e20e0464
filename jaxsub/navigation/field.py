r"""A magnetometer against the gyros: its delay, and what magnets that turn with it add.

The Earth's field stands still, so in body axes $\dot m = -(\omega - b_g)\times(m - b)$ with the field b of whatever is
fixed to the vehicle. Both sides are averaged with a smooth window φ, $-\int\dot\varphi\,m\,dt$ on the left, so that no
noise is differentiated. For each delay b and $b_g$ follow by least squares, and of the delays the best is taken.
Source: Alonso and Shuster (2002), J. Astronautical Sciences 50, on attitude-independent calibration.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..findings import Finding
from .suite import Sensor, SensorSuite
from .suite.log import SensorLog, interpolated

# s: delays that are tried, and the window's length; samples that it has at least
_EARLIEST, _LATEST, _STEP, _WINDOW, _LEAST = -0.05, 0.15, 0.005, 0.1, 8
# s within which residuals are taken to be correlated, and how many such blocks standard errors need
_BLOCK, _FEWEST = 1.0, 15
# s, of a delay that is worth correcting for
_SHARP = 0.005
# of the field: hard iron with this standard error is corrected
_KNOWN = 0.02


class FieldFit(NamedTuple):
    """What gyros and magnetometer say together.

    **Fields**

    - `delay`: s by which the magnetometer is older than the gyros; `delay_std`: its standard error.
    - `hard_iron`: (3,) field fixed to the vehicle, body axes, in the magnetometer's unit; `hard_iron_std`: (3,).
    - `before`, `after`: spread of the field's strength over its mean, as read and without the hard iron.
    - `delayed`, `corrected`: whether delay and hard iron were taken off the readings.
    """

    delay: float
    delay_std: float
    hard_iron: np.ndarray
    hard_iron_std: np.ndarray
    before: float
    after: float
    delayed: bool
    corrected: bool


class Averaged(NamedTuple):
    """Columns averaged with a window."""

    window: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(K - w + 1, 3) of values (K, 3)."""
        return np.stack([np.convolve(column, self.window, "valid") for column in values.T], axis=1)


def with_field(log: SensorLog, suite: SensorSuite) -> tuple[SensorLog, SensorSuite, FieldFit | None]:
    """The log and its suite with the magnetometer's delay and hard iron taken off where the file requests that.

    A delay or a field that the motion does not show to 5 ms or 2 % of the field stays, and a finding says so.
    """
    sensor = next(iter(suite.of("magnetometer")), None)
    if sensor is None or not (sensor.delay_std > 0.0 or sensor.calibration != "none"):
        return log, suite, None
    fit = fit_field(log, suite, sensor)
    seen, findings = log.readings[sensor.name], list(log.findings)
    strength = float(np.nanmedian(np.linalg.norm(seen, axis=1)))
    sharp, known = fit.delay_std < _SHARP, bool((fit.hard_iron_std < _KNOWN * strength).all())
    if sensor.delay_std > 0.0:
        delay = sensor.delay + fit.delay if sharp else sensor.delay
        plain = dataclasses.replace(sensor, delay=delay, delay_std=0.0)
        suite = dataclasses.replace(suite, sensors=tuple(plain if one is sensor else one for one in suite.sensors))
        if not sharp:
            findings.append(
                _open(log, sensor, f"its delay is known to {1e3 * fit.delay_std:.2g} ms only", "turn faster")
            )
    if sensor.calibration != "none" and known:
        log = dataclasses.replace(log, readings=log.readings | {sensor.name: seen - fit.hard_iron})
    elif sensor.calibration != "none":
        share = 100.0 * float(fit.hard_iron_std.max()) / strength
        findings.append(
            _open(log, sensor, f"its hard iron is known to {share:.2g} % of the field only", "turn about two axes")
        )
    fit = fit._replace(delayed=sensor.delay_std > 0.0 and sharp, corrected=sensor.calibration != "none" and known)
    return dataclasses.replace(log, findings=tuple(findings)), suite, fit


def _open(log: SensorLog, sensor: Sensor, what: str, remedy: str) -> Finding:
    said = f"{what}, and it is left as it is"
    return Finding("magnetometer", "warning", log.source, said, remedy, channel=", ".join(sensor.columns))


def fit_field(log: SensorLog, suite: SensorSuite, sensor: Sensor) -> FieldFit:
    """Delay beyond the stated one and hard iron by least squares over all of the log."""
    times, m = log.complete(sensor.name)
    gyro_times, rate = log.complete(suite.only("gyro").name)
    interval = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], interval)
    field = interpolated(grid, times, m)
    length = max(_LEAST, round(_WINDOW / interval)) + 1
    # with two zeros at each end the slope is of central differences all through
    window = np.pad(np.hanning(length + 2), 1)
    window /= window.sum()
    # of a window that is symmetric the slope is odd: convolved with m it is the averaged slope of m
    slope = np.gradient(window, interval)
    average = Averaged(window)
    left = Averaged(slope)(field)
    held = np.stack([average(_cross(field)[:, :, i]) for i in range(3)], axis=2)
    at = lambda lag: _system(left, held, average, field, interpolated(grid - sensor.delay - lag, gyro_times, rate))
    lags = np.arange(_EARLIEST, _LATEST + 0.5 * _STEP, _STEP)
    loss = np.array([_solved(*at(lag))[1] for lag in lags])
    lowest = int(np.argmin(loss))
    a, b, c = loss[(best := int(np.clip(lowest, 1, len(lags) - 2))) - 1 : best + 2]
    inside = lowest == best and a - 2.0 * b + c > 0.0
    delay = float(lags[lowest] + (0.5 * _STEP * (a - c) / (a - 2.0 * b + c) if inside else 0.0))
    A, right = at(delay)
    solved, _ = _solved(A, right)
    later, sooner = (at(delay + sign * _STEP) for sign in (1.0, -1.0))
    by_delay = ((later[0] - sooner[0]) @ solved - (later[1] - sooner[1])) / (2.0 * _STEP)
    count = max(1, round(_BLOCK / interval))
    std = _errors(np.concatenate([A, by_delay[:, :, None]], axis=2), right - A @ solved, count)
    spread = lambda values: float(np.std(np.linalg.norm(values, axis=1)) / np.mean(np.linalg.norm(values, axis=1)))
    delay_std = float(std[6]) if inside else np.inf
    return FieldFit(delay, delay_std, solved[:3], std[:3], spread(m), spread(m - solved[:3]), False, False)


def _system(
    left: np.ndarray, held: np.ndarray, average: Averaged, field: np.ndarray, rate: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""(K, 3, 6) and (K, 3) of $\dot m + \omega\times m = \omega\times b + b_g\times m$, by b and the gyros' bias."""
    by_iron = np.stack([average(_cross(rate)[:, :, i]) for i in range(3)], axis=2)
    return np.concatenate([by_iron, -held], axis=2), left + average(np.cross(rate, field))


def _solved(A: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, float]:
    """The least-squares solution and its squared residual."""
    flat = A.reshape(-1, A.shape[-1])
    solved = np.linalg.pinv(flat.T @ flat) @ (flat.T @ right.ravel())
    return solved, float(np.sum((right - A @ solved) ** 2))


def _errors(A: np.ndarray, residual: np.ndarray, count: int) -> np.ndarray:
    """Standard errors that hold for residuals correlated within `count` rows: by the sums of such blocks' scores.

    Source: White (1980), Econometrica 48, with clusters.
    """
    blocks = len(A) // count
    flat = A.reshape(-1, A.shape[-1])
    if blocks < _FEWEST or np.linalg.matrix_rank(flat) < flat.shape[1]:
        return np.full(A.shape[-1], np.inf)
    scores = np.einsum("kip,ki->kp", A, residual)[: blocks * count].reshape(blocks, count, -1).sum(axis=1)
    normal = np.linalg.inv(flat.T @ flat)
    return np.sqrt(np.diag(normal @ (scores.T @ scores) @ normal) * blocks / (blocks - flat.shape[1]))


def _cross(v: np.ndarray) -> np.ndarray:
    """(K, 3, 3) matrices of v ×."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], 1)
