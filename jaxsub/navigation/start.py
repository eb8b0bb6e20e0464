"""Where a run begins: attitude, velocity, position and biases from the first readings, at rest or in motion."""

import math
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..effects import GRAVITY
from .aided import SCALES
from .alignment import MagneticField, aligned
from .fix_alignment import aligned_by_fixes
from .rotation import UNKNOWN, turned
from .suite import SensorSuite
from .suite.log import SensorLog, interpolated

# s from which rest is judged; rad/s and m/s² by which readings of a unit at rest differ at most, rms
_WINDOW, _STILL_RATE, _STILL_FORCE = 1.0, math.radians(0.5), 0.2
_NEAR_GRAVITY = 0.5
# standard deviations at rest: tilt, heading by a field, velocity; in motion: tilt, velocity
_REST = (0.02, 0.05, 0.1)
_MOVING = (0.3, 5.0)
# times the deviations found from a run's first seconds, with which the run begins
WIDER = 3.0
# share of the field by which it differs from place to place
FIELD_SPREAD = 0.03


class Start(NamedTuple):
    """A run's first state and standard deviations.

    **Fields**

    - `x`: (25,) state without delays. `std`: (24,) of its changes. `rest`: whether the unit is still at first.
    - `heading`: `measured`, `by fixes`, `unknown` (fixes do not show it) or `relative` (it counts from the start).
    """

    x: np.ndarray
    std: np.ndarray
    rest: bool
    heading: str


def field_of(log: SensorLog, suite: SensorSuite) -> MagneticField | None:
    """The field by the medians of its strength and dip over the log, the accelerometer showing the vertical."""
    found = suite.of("magnetometer")
    if not found:
        return None
    times, seen = log.complete(found[0].name)
    held = interpolated(times, *log.complete(suite.only("accelerometer").name))
    strength = np.linalg.norm(seen, axis=1)
    along = -np.sum(seen * held, axis=1) / np.maximum(np.linalg.norm(held, axis=1) * strength, 1e-300)
    size, dip = float(np.median(strength)), float(np.median(np.arcsin(np.clip(along, -1.0, 1.0))))
    spread = found[0].sigma[0] if found[0].sigma[0] > 0.0 else FIELD_SPREAD * size
    return MagneticField(size * math.cos(dip), size * math.sin(dip), spread)


def start_of(log: SensorLog, suite: SensorSuite) -> Start:
    """The start of a log: levelled by its first second, with the heading of a field, of a compass or of fixes."""
    gyro, accelerometer = suite.only("gyro"), suite.only("accelerometer")
    rates, forces = _early(log, gyro.name), _early(log, accelerometer.name)
    force = forces.mean(axis=0) if len(forces) else log.complete(accelerometer.name)[1][0]
    rest = _at_rest(rates, forces)
    fields = [_early(log, sensor.name) for sensor in suite.of("magnetometer")]
    field = fields[0].mean(axis=0) if fields and len(fields[0]) else np.full(3, np.nan)
    found = aligned(jnp.asarray(force), jnp.asarray(field))
    tilt, turn, slow = _REST if rest else (_MOVING[0], _MOVING[0], _MOVING[1])
    q, heading, turn = _heading(log, suite, np.asarray(found.q), bool(found.heading), turn)
    velocity, position, place = _first_motion(log, suite)
    assert gyro.noise is not None and accelerometer.noise is not None
    bias_std = gyro.noise.bias
    bias = np.zeros(3)
    if rest:
        # what it shows at rest is bias, but for its noise and Earth's rate
        bias, bias_std = rates.mean(axis=0), min(bias_std, gyro.noise.density / math.sqrt(_WINDOW) + 7.3e-5)
    known = {"tilt_std": tilt} if rest else {}
    by_fixes = aligned_by_fixes(log, suite, q, bias, bias_std, **known) if heading == "unknown" else None
    sizes = [tilt, slow, place, bias_std, accelerometer.noise.bias, max(gyro.noise.scale_error, 1e-6)]
    std = np.repeat(sizes, [3, 3, 3, 3, 3, SCALES])
    std[2] = turn
    if by_fixes is not None:
        # the filter is given the same fixes again: biases are as beforehand, and of the attitude, which is wider, nine
        # tenths of what it finds are of its own
        q, velocity = by_fixes.q_without, by_fixes.velocity_without
        heading = "by fixes" if by_fixes.shows_heading else "unknown"
        std[:3] = np.minimum(WIDER * by_fixes.std[:3], UNKNOWN)
    x = np.concatenate([q, velocity, position, bias, np.zeros(3 + SCALES)])
    return Start(x, std, rest, heading)


def _early(log: SensorLog, name: str) -> np.ndarray:
    """A sensor's complete samples from which rest is judged."""
    times, values = log.complete(name)
    return values[times <= log.times[0] + _WINDOW]


def _at_rest(rates: np.ndarray, forces: np.ndarray) -> bool:
    if len(rates) < 5 or len(forces) < 5:
        return False
    turning = float(np.sqrt(np.mean(np.sum((rates - rates.mean(axis=0)) ** 2, axis=1))))
    size = np.linalg.norm(forces, axis=1)
    uneven, off = float(size.std()), float(abs(size.mean() - GRAVITY))
    return turning < _STILL_RATE and uneven < _STILL_FORCE and off < _NEAR_GRAVITY


def _heading(
    log: SensorLog, suite: SensorSuite, q: np.ndarray, by_field: bool, turn: float
) -> tuple[np.ndarray, str, float]:
    """The attitude with its heading, how that is known, and its standard deviation, rad."""
    for sensor in suite.of("compass"):
        first = jnp.asarray(log.complete(sensor.name)[1][0, 0])
        return np.asarray(turned(jnp.asarray(q), first)), "measured", max(turn, sensor.sigma[0])
    for sensor in suite.of("magnetometer"):
        if by_field:
            return np.asarray(turned(jnp.asarray(q), jnp.asarray(sensor.declination))), "measured", turn
    if suite.of("gps", "usbl", "velocity"):
        return q, "unknown", turn
    return q, "relative", 1e-3


def _first_motion(log: SensorLog, suite: SensorSuite) -> tuple[np.ndarray, np.ndarray, float]:
    """Velocity zero, position by the first fixes, and the position's standard deviation, m."""
    position, place = np.zeros(3), 0.1
    for sensor in (*suite.of("gps", "usbl"), *suite.of("pressure", "depth")):
        row = log.complete(sensor.name)[1][0]
        if sensor.kind in ("pressure", "depth"):
            position[2] = row[0]
        else:
            position[: len(row)] = row
        place = 1.0 if place == 0.1 else place
    return np.zeros(3), position, max(place, 1.0) if place > 0.1 else place
