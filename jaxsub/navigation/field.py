r"""A magnetometer against the gyros: its delay, and what magnets and iron that turn with it do to the field.

The Earth's field stands still, so in body axes $\dot h = -(\omega - b_g)\times h$ of $h = (I + D)m - b$, with b the
field of whatever is fixed to the vehicle (hard iron) and D what its iron and the sensor's own axes do (soft iron, scale
errors, misalignment). The strength of the Earth's field is no matter, so D has no trace. Both sides are averaged with a
smooth window φ, $-\int\dot\varphi\,m\,dt$ on the left, so that no noise is differentiated. For each delay b and $b_g$
follow by least squares, and of the delays the best is taken; D is found with that.
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


# matrices without a trace: what is not on the diagonal one by one, and two differences of what is
_OFF = [np.outer(np.eye(3)[i], np.eye(3)[j]) for i in range(3) for j in range(3) if i != j]
_TRACELESS = np.stack([*_OFF, np.diag([1.0, 0.0, -1.0]), np.diag([0.0, 1.0, -1.0])])


class FieldFit(NamedTuple):
    """What gyros and magnetometer say together.

    **Fields**

    - `delay`: s by which the magnetometer is older than the gyros; `delay_std`: its standard error.
    - `hard_iron`: (3,) field fixed to the vehicle, body axes, in the magnetometer's unit; `hard_iron_std`: (3,).
    - `soft_iron`: (3, 3) I + D that readings are multiplied by before the hard iron is taken off, I where D is not
      fitted; `soft_iron_std`: (3, 3).
    - `before`, `after`: spread of the field's strength over its mean, as read and calibrated.
    - `delayed`: whether the delay was taken off the readings. `corrected`: what else was: `none`, `hard-iron` or
      `soft-iron` with hard iron.
    """

    delay: float
    delay_std: float
    hard_iron: np.ndarray
    hard_iron_std: np.ndarray
    soft_iron: np.ndarray
    soft_iron_std: np.ndarray
    before: float
    after: float
    delayed: bool = False
    corrected: str = "none"

    def calibrated(self, field: np.ndarray) -> np.ndarray:
        """(K, 3) readings without hard and soft iron."""
        return field @ self.soft_iron.T - self.hard_iron

    def unknown(self, strength: float) -> tuple[str, float]:
        """What of the calibration is known worst in a field of this `strength`, and its standard error as a share."""
        parts = {"hard iron": self.hard_iron_std.max() / strength, "soft iron": self.soft_iron_std.max()}
        worst = max(parts, key=lambda name: parts[name])
        return worst, float(parts[worst])


class Averaged(NamedTuple):
    """Columns averaged with a window."""

    window: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """(K - w + 1, 3) of values (K, 3)."""
        return np.stack([np.convolve(column, self.window, "valid") for column in values.T], axis=1)


def with_field(log: SensorLog, suite: SensorSuite) -> tuple[SensorLog, SensorSuite, FieldFit | None]:
    """The log and its suite with the magnetometer's delay, hard and soft iron taken off where the file requests that.

    A delay or a field that the motion does not show to 5 ms or 2 % of the field stays, and a finding says so. Where the
    soft iron is not shown the hard iron alone may be.
    """
    sensor = next(iter(suite.of("magnetometer")), None)
    if sensor is None or not (sensor.delay_std > 0.0 or sensor.calibration != "none"):
        return log, suite, None
    seen, findings = log.readings[sensor.name], list(log.findings)
    strength = float(np.nanmedian(np.linalg.norm(seen, axis=1)))
    fit = fit_field(log, suite, sensor, sensor.calibration == "soft-iron")
    corrected = sensor.calibration
    while corrected != "none":
        part, share = fit.unknown(strength)
        if share < _KNOWN:
            log = dataclasses.replace(log, readings=log.readings | {sensor.name: fit.calibrated(seen)})
            break
        what = f"its {part} is known to {100.0 * share:.2g} % of the field only"
        findings.append(_open(log, sensor, what, "turn about two axes"))
        corrected = "hard-iron" if corrected == "soft-iron" else "none"
        fit = fit_field(log, suite, sensor, soft=False)
    sharp = fit.delay_std < _SHARP
    if sensor.delay_std > 0.0:
        delay = sensor.delay + fit.delay if sharp else sensor.delay
        plain = dataclasses.replace(sensor, delay=delay, delay_std=0.0)
        suite = dataclasses.replace(suite, sensors=tuple(plain if one is sensor else one for one in suite.sensors))
        if not sharp:
            findings.append(
                _open(log, sensor, f"its delay is known to {1e3 * fit.delay_std:.2g} ms only", "turn faster")
            )
    fit = fit._replace(delayed=sensor.delay_std > 0.0 and sharp, corrected=corrected)
    return dataclasses.replace(log, findings=tuple(findings)), suite, fit


def _open(log: SensorLog, sensor: Sensor, what: str, remedy: str) -> Finding:
    said = f"{what}, and it is left as it is"
    return Finding("magnetometer", "warning", log.source, said, remedy, channel=", ".join(sensor.columns))


def fit_field(log: SensorLog, suite: SensorSuite, sensor: Sensor, soft: bool) -> FieldFit:
    """Delay beyond the stated one, hard iron and, if `soft`, soft iron by least squares over all of the log."""
    times, m = log.complete(sensor.name)
    gyro = suite.only("gyro")
    gyro_times, rate = log.complete(gyro.name)
    if gyro.sampling == "mean":
        gyro_times = gyro_times - 0.5 * float(np.median(np.diff(gyro_times)))
    interval = float(np.median(np.diff(times)))
    grid = np.arange(times[0], times[-1], interval)
    field = interpolated(grid, times, m)
    length = max(_LEAST, round(_WINDOW / interval)) + 1
    # with two zeros at each end the slope is of central differences all through
    window = np.pad(np.hanning(length + 2), 1)
    window /= window.sum()
    average = Averaged(window)
    # of a window that is symmetric the slope is odd: convolved with m it is the averaged slope of m
    slope = Averaged(np.gradient(window, interval))
    held = np.stack([average(_cross(field)[:, :, i]) for i in range(3)], axis=2)
    left = slope(field)
    rate_at = lambda lag: interpolated(grid - sensor.delay - lag, gyro_times, rate)
    at = lambda lag: _system(left, held, average, field, rate_at(lag))
    lags = np.arange(_EARLIEST, _LATEST + 0.5 * _STEP, _STEP)
    loss = np.array([_solved(*at(lag))[1] for lag in lags])
    lowest = int(np.argmin(loss))
    a, b, c = loss[(best := int(np.clip(lowest, 1, len(lags) - 2))) - 1 : best + 2]
    inside = lowest == best and a - 2.0 * b + c > 0.0
    delay = float(lags[lowest] + (0.5 * _STEP * (a - c) / (a - 2.0 * b + c) if inside else 0.0))
    A, right = at(delay)
    by_soft = _by_soft_iron(slope, average, field, rate_at(delay)) if soft else np.zeros((*right.shape, 0))
    solved, _ = _solved(np.concatenate([A, by_soft], axis=2), right)
    later, sooner = (at(delay + sign * _STEP) for sign in (1.0, -1.0))
    by_delay = ((later[0] - sooner[0]) @ solved[:6] - (later[1] - sooner[1])) / (2.0 * _STEP)
    whole = np.concatenate([A, by_soft, by_delay[:, :, None]], axis=2)
    covariance = _covariance(whole, right - whole[:, :, :-1] @ solved, max(1, round(_BLOCK / interval)))
    D, D_variance = np.zeros((3, 3)), np.zeros((3, 3))
    if soft:
        D = np.einsum("k,kij->ij", solved[6:], _TRACELESS)
        D_variance = np.einsum("kij,kl,lij->ij", _TRACELESS, covariance[6:-1, 6:-1], _TRACELESS)
        # infinite times zero where nothing is known
        D_variance = np.where(np.isnan(D_variance), np.inf, D_variance)
    std = np.sqrt(np.diag(covariance))
    spread = lambda values: float(np.std(np.linalg.norm(values, axis=1)) / np.mean(np.linalg.norm(values, axis=1)))
    fit = FieldFit(
        delay, float(std[-1]) if inside else np.inf, solved[:3], std[:3], np.eye(3) + D, np.sqrt(D_variance),
        spread(m), 0.0,
    )  # fmt: skip
    return fit._replace(after=spread(fit.calibrated(m)))


def _system(
    left: np.ndarray, held: np.ndarray, average: Averaged, field: np.ndarray, rate: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""(K, 3, 6) and (K, 3) of $\dot m + \omega\times m = \omega\times b + b_g\times m$, by b and the gyros' bias."""
    by_iron = np.stack([average(_cross(rate)[:, :, i]) for i in range(3)], axis=2)
    return np.concatenate([by_iron, -held], axis=2), left + average(np.cross(rate, field))


def _by_soft_iron(slope: Averaged, average: Averaged, field: np.ndarray, rate: np.ndarray) -> np.ndarray:
    r"""(K, 3, 8) of $-D\dot m - \omega\times Dm$, by the numbers of D."""
    parts = (field @ part.T for part in _TRACELESS)
    return np.stack([-slope(part) - average(np.cross(rate, part)) for part in parts], axis=2)


def _solved(A: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, float]:
    """The least-squares solution and its squared residual."""
    flat = A.reshape(-1, A.shape[-1])
    solved = np.linalg.pinv(flat.T @ flat) @ (flat.T @ right.ravel())
    return solved, float(np.sum((right - A @ solved) ** 2))


def _covariance(A: np.ndarray, residual: np.ndarray, count: int) -> np.ndarray:
    """Covariance that holds for residuals correlated within `count` rows: by the sums of such blocks' scores.

    Source: White (1980), Econometrica 48, with clusters.
    """
    blocks = len(A) // count
    flat = A.reshape(-1, A.shape[-1])
    if blocks < max(_FEWEST, 2 * A.shape[-1]) or np.linalg.matrix_rank(flat) < flat.shape[1]:
        return np.diag(np.full(A.shape[-1], np.inf))
    scores = np.einsum("kip,ki->kp", A, residual)[: blocks * count].reshape(blocks, count, -1).sum(axis=1)
    normal = np.linalg.inv(flat.T @ flat)
    return normal @ (scores.T @ scores) @ normal * blocks / (blocks - flat.shape[1])


def _cross(v: np.ndarray) -> np.ndarray:
    """(K, 3, 3) matrices of v ×."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], 1)
