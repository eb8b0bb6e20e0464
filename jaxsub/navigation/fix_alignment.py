r"""Attitude in motion by fixes alone: they show how the vehicle accelerates over ground, the sensors how in its axes.

With $R(t)$ the attitude relative to the start, by the gyros, fixes of position follow

$$p(t) = p_0 + v_0 t + \tfrac12 g t^2 + C \left(\iint R\,(f - b_a)\,dt^2 + R(t)\,l\right),$$

whose unknowns are the attitude C at the start, $p_0$, $v_0$ and the biases of accelerometer and gyro. R depends on the
latter. Fixes of velocity follow the same, integrated once. The unknowns are found by least squares, over a window that
is doubled until it shows the heading. The sensors' white noise makes errors of the integrals that grow and are
correlated: with density s and n integrals, $\int_0^{\min(t,u)}s^2(t-r)^{n-1}(u-r)^{n-1}/(n-1)!^2\,dr$ of times t and u.
Source: Wu and Pan (2013), Velocity/position integration formula, part I, IEEE
Transactions on Aerospace and Electronic Systems 49 (2); biases are added.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import solve_triangular
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from ..effects import GRAVITY
from .suite import Sensor, SensorSuite
from .suite.grades import motion_density
from .suite.log import SensorLog, interpolated

# s of the first window, and rad to which a heading is known: a filter may linearise about an attitude so far off
_WINDOW, _KNOWN = 5.0, 0.15
# s between the attitudes of the integral
_STEP = 0.05
# rad about each axis from which the search begins: any
_ANY = 3.0
_LEAST_FIXES = 4


class FixAlignment(NamedTuple):
    """What fixes say of a start in motion.

    **Fields**

    - `q`: (4,) attitude; `velocity`: (3,) m/s, NED. `gyro_bias`: (3,) rad/s; `accelerometer_bias`: (3,) m/s².
    - `std`: (9,) standard deviations of the attitude about north, east and down, rad, and of both biases.
    - `q_without`, `velocity_without`: the likeliest with biases as they were known beforehand.
    """

    q: np.ndarray
    velocity: np.ndarray
    gyro_bias: np.ndarray
    accelerometer_bias: np.ndarray
    std: np.ndarray
    q_without: np.ndarray
    velocity_without: np.ndarray

    @property
    def shows_heading(self) -> bool:
        """Whether the heading is known well enough for a filter to begin with it."""
        return bool(self.std[2] < _KNOWN)


def aligned_by_fixes(
    log: SensorLog,
    suite: SensorSuite,
    q: np.ndarray,
    gyro_bias: np.ndarray,
    gyro_bias_std: float,
    tilt_std: float = _ANY,
) -> FixAlignment | None:
    """The start that explains a log's fixes over a window that shows the heading, or over all of it.

    `q` (4,) is an attitude whose tilt is known to `tilt_std` rad, if at all, and `gyro_bias` (3,) rad/s is known to
    `gyro_bias_std`. None for a log without a sensor that has four fixes.
    """
    noise = suite.only("accelerometer").noise
    assert noise is not None
    white = _white(log, suite)
    fixes = [_Fixes.of(log, suite, sensor) for sensor in suite.of("gps", "usbl", "velocity")]
    least = max((one.times[_LEAST_FIXES - 1] for one in fixes if len(one.times) >= _LEAST_FIXES), default=np.inf)
    if not np.isfinite(least):
        return None
    motion, end, first = _Motion.of(log, suite), log.times[-1], log.times[0]
    prior = (
        np.concatenate([np.zeros(3), gyro_bias, np.zeros(3)]),
        np.concatenate([[tilt_std, tilt_std, _ANY], np.repeat([gyro_bias_std, noise.bias], 3)]),
    )
    x, level = prior[0], Rotation.from_quat(np.roll(q, -1))
    about, length = None, _WINDOW
    while True:
        until = first + length
        if until >= min(least, end):
            part, seen = motion.until(until), [one.until(until) for one in fixes]
            weights = [one.weights(first, white) for one in seen]
            about = _headed(part, seen, level, x) if about is None else about
            x, covariance = _fitted(part, seen, weights, about, x, *prior)
            std = np.sqrt(np.diag(covariance))
            if std[2] < _KNOWN or until >= end:
                break
        length *= 2.0
    attitude = Rotation.from_rotvec(x[:3]) * about
    turn = covariance[:3, 3:] @ np.linalg.solve(covariance[3:, 3:], prior[0][3:] - x[3:])
    starts = ((attitude, x), (Rotation.from_rotvec(turn) * attitude, prior[0]))
    (q, velocity), without = (
        (np.roll(one.as_quat(), 1), _velocity(part, seen[0], one, biases)) for one, biases in starts
    )
    return FixAlignment(q, velocity, x[3:6], x[6:], std, *without)


class _Path(NamedTuple):
    """Attitudes (k, 3, 3), velocities and positions (k, 3) at `times` (k,), without gravity, in axes of the start."""

    times: np.ndarray
    R: np.ndarray
    velocity: np.ndarray
    position: np.ndarray


class _Motion(NamedTuple):
    """Integrals of the sensors' readings between times: `times` (k + 1,) s, `turns` (k, 3) rad, `gains` (k, 3) m/s."""

    times: np.ndarray
    turns: np.ndarray
    gains: np.ndarray

    @classmethod
    def of(cls, log: SensorLog, suite: SensorSuite) -> "_Motion":
        grid = np.arange(log.times[0], log.times[-1] + _STEP, _STEP)
        between = lambda times, values: np.diff(
            interpolated(grid, times, cumulative_trapezoid(values, times, axis=0, initial=0.0)), axis=0
        )
        return cls(grid, *(between(*log.complete(suite.only(kind).name)) for kind in ("gyro", "accelerometer")))

    def until(self, time: float) -> "_Motion":
        """The part that ends at or after a time."""
        k = int(np.searchsorted(self.times, time))
        return _Motion(self.times[: k + 1], self.turns[:k], self.gains[:k])

    def path(self, x: np.ndarray) -> _Path:
        """The path with the biases of x (9,)."""
        dt = np.diff(self.times)[:, None]
        turns = self.turns - x[3:6] * dt
        R = np.concatenate([np.eye(3)[None], _products(Rotation.from_rotvec(turns).as_matrix())])
        middle = R[:-1] @ Rotation.from_rotvec(0.5 * turns).as_matrix()
        gains = np.einsum("kij,kj->ki", middle, self.gains - x[6:] * dt)
        velocity = np.concatenate([np.zeros((1, 3)), np.cumsum(gains, axis=0)])
        return _Path(self.times, R, velocity, cumulative_trapezoid(velocity, self.times, axis=0, initial=0.0))


def _products(factors: np.ndarray) -> np.ndarray:
    """(k, 3, 3) products of the first, the first two, ... factors, in log k passes (Hillis and Steele, 1986)."""
    found, shift = factors, 1
    while shift < len(found):
        found = np.concatenate([found[:shift], found[:-shift] @ found[shift:]])
        shift *= 2
    return found


class _Fixes(NamedTuple):
    """Fixes of one sensor.

    `times` (m,) s, `values` (m, a) and `sigma` (a,) of the first a axes; `arm` (3,) m from the accelerometer;
    `integrals`: of the acceleration, 2 for a position and 1 for a velocity.
    """

    times: np.ndarray
    values: np.ndarray
    sigma: np.ndarray
    arm: np.ndarray
    integrals: int

    @classmethod
    def of(cls, log: SensorLog, suite: SensorSuite, sensor: Sensor) -> "_Fixes":
        times, values = log.complete(sensor.name)
        arm = np.subtract(sensor.lever_arm, suite.only("accelerometer").lever_arm)
        inside = times >= log.times[0] + sensor.delay
        integrals = 1 if sensor.kind == "velocity" else 2
        return cls(times[inside] - sensor.delay, values[inside], np.asarray(sensor.sigma), arm, integrals)

    def until(self, time: float) -> "_Fixes":
        """Those up to a time."""
        return self._replace(times=self.times[self.times <= time], values=self.values[self.times <= time])

    def apart_from_gravity(self, start: float) -> np.ndarray:
        """(m, a) fixes without what gravity adds to them from the `start` on."""
        fallen = GRAVITY * (self.times - start) ** self.integrals / self.integrals
        return self.values - fallen[:, None] * np.array([0.0, 0.0, 1.0])[: self.values.shape[1]]

    def by_sensors(self, path: _Path) -> np.ndarray:
        """(m, 3) what the inertial sensors show in place of them, in the axes of the start."""
        moved = path.position + path.R @ self.arm if self.integrals == 2 else path.velocity
        return interpolated(self.times, path.times, moved)

    def powers(self, start: float) -> np.ndarray:
        """(m, n) powers of time that the unknown first position and velocity add."""
        return np.vander(self.times - start, self.integrals, increasing=True)

    def weights(self, start: float, white: tuple[float, float]) -> np.ndarray:
        """(a, m, m) by which residuals of each axis become white, without what the first position and velocity add.

        `white`: densities of the specific force and the rate, m/s²/√Hz and rad/s/√Hz.
        """
        since = self.times - start
        force, rate = white
        # an attitude that strays turns gravity
        strayed = force**2 * _integrated(since, self.integrals)
        strayed += (GRAVITY * rate) ** 2 * _integrated(since, self.integrals + 1)
        return np.stack([self._weight(start, strayed + sigma**2 * np.eye(len(since))) for sigma in self.sigma])

    def _weight(self, start: float, covariance: np.ndarray) -> np.ndarray:
        whitening = solve_triangular(np.linalg.cholesky(covariance), np.eye(len(covariance)), lower=True)
        Q, _ = np.linalg.qr(whitening @ self.powers(start))
        return whitening - Q @ (Q.T @ whitening)

    def without_start(self, values: np.ndarray, start: float) -> np.ndarray:
        """`values` (m, n) less what the first position and velocity could add to them."""
        Q, _ = np.linalg.qr(self.powers(start))
        return values - Q @ (Q.T @ values)


def _white(log: SensorLog, suite: SensorSuite) -> tuple[float, float]:
    """Densities of the errors of specific force and rate: of noise, and of scale errors by how much these vary."""
    found = []
    for kind in ("accelerometer", "gyro"):
        sensor = suite.only(kind)
        assert sensor.noise is not None
        varies = float(np.std(log.complete(sensor.name)[1], axis=0).max())
        share = math.hypot(sensor.noise.scale_error, sensor.noise.nonlinearity)
        found.append(math.hypot(sensor.noise.density, motion_density(share) * varies))
    return found[0], found[1]


def _integrated(since: np.ndarray, integrals: int) -> np.ndarray:
    """(m, m) covariance at times `since` (m,) of white noise of density one that is integrated so many times."""
    a, b = np.minimum(since[:, None], since), np.maximum(since[:, None], since)
    match integrals:
        case 1:
            return a
        case 2:
            return a**2 * (3.0 * b - a) / 6.0
        case _:
            return a**3 * (10.0 * b**2 - 5.0 * a * b + a**2) / 120.0


def _headed(motion: _Motion, fixes: Sequence[_Fixes], level: Rotation, x: np.ndarray) -> Rotation:
    """The level attitude turned about the vertical to the heading that explains the fixes best, in closed form."""
    along = across = 0.0
    start, path = motion.times[0], motion.path(x)
    for one in fixes:
        seen = one.without_start(one.apart_from_gravity(start), start)
        shown = level.apply(one.without_start(one.by_sensors(path), start))
        along += float(np.sum(seen[:, :2] * shown[:, :2]))
        across += float(np.sum(seen[:, 1] * shown[:, 0] - seen[:, 0] * shown[:, 1]))
    return Rotation.from_rotvec([0.0, 0.0, np.arctan2(across, along)]) * level


def _fitted(
    motion: _Motion, fixes: Sequence[_Fixes], weights: Sequence[np.ndarray], about: Rotation, x: np.ndarray,
    mean: np.ndarray, std: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The turn from `about` and the biases, (9,), that explain the fixes beside their prior, and their covariance."""
    start = motion.times[0]

    def residuals(x: np.ndarray) -> np.ndarray:
        attitude, path, found = Rotation.from_rotvec(x[:3]) * about, motion.path(x), [(x - mean) / std]
        for one, weight in zip(fixes, weights, strict=True):
            shown = attitude.apply(one.by_sensors(path))[:, : one.values.shape[1]]
            rest = one.apart_from_gravity(start) - shown
            found.append(np.einsum("akm,ma->ka", weight, rest).ravel())
        return np.concatenate(found)

    found = least_squares(residuals, x, x_scale=std)
    covariance = np.linalg.inv(found.jac.T @ found.jac)
    moved = np.eye(9)
    moved[:3, :3] = _turns_of_vector(found.x[:3])
    return found.x, moved @ covariance @ moved.T


def _turns_of_vector(v: np.ndarray) -> np.ndarray:
    """(3, 3) small turns about north, east and down by changes of a rotation vector `v`, which may be large itself."""
    step = 1e-6
    changed = Rotation.from_rotvec(v + step * np.eye(3)) * Rotation.from_rotvec(v).inv()
    return changed.as_rotvec().T / step


def _velocity(motion: _Motion, fixes: _Fixes, attitude: Rotation, x: np.ndarray) -> np.ndarray:
    """(3,) the velocity at the start, m/s; zero in axes without fixes."""
    start, axes = motion.times[0], fixes.values.shape[1]
    rest = fixes.apart_from_gravity(start) - attitude.apply(fixes.by_sensors(motion.path(x)))[:, :axes]
    found = np.linalg.lstsq(fixes.powers(start), rest)[0][-1]
    return np.concatenate([found, np.zeros(3 - axes)])
