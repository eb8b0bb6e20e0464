"""The sensors of a vehicle, and what is known of its motion beside them."""

import dataclasses
import math
from typing import NamedTuple, TypeVar

from .grades import Grade

T = TypeVar("T")
Vector = tuple[float, float, float]


class Kind(NamedTuple):
    """What all sensors of a kind have in common.

    **Fields**

    - `channels`: sets of channels that it may measure, of which the first with as many as there are columns is taken.
    - `units`: SI unit by channel. `sigma`: usual standard deviation by channel, SI.
    - `frames`: the usual one first; none where the kind has no axes.
    - `keys`: that it may have beside those of every sensor.
    """

    channels: tuple[tuple[str, ...], ...]
    units: dict[str, str]
    sigma: dict[str, float]
    frames: tuple[str, ...]
    keys: tuple[str, ...]


_BODY, _EARTH = ("FRD", "FLU"), ("NED", "ENU")
_AXES = ("x", "y", "z")
_FIX_UNITS = {"x": "m", "y": "m", "z": "m", "latitude": "rad", "longitude": "rad", "altitude": "m"}
# rad of latitude and longitude that are a metre and a half
_GEODETIC = 2.4e-7
_FIX_SIGMA = {"x": 1.5, "y": 1.5, "z": 3.0, "latitude": _GEODETIC, "longitude": _GEODETIC, "altitude": 3.0}


def _triad(value: T) -> dict[str, T]:
    """The same of each axis."""
    return {axis: value for axis in _AXES}  # noqa: C420


_INERTIAL = (
    "grade", "density", "bias", "wander", "scale_error", "nonlinearity", "range", "sampling", "mounting",
)  # fmt: skip
_AIDING = ("sigma", "correlation", "delay", "rate")

KINDS: dict[str, Kind] = {
    "gyro": Kind((_AXES,), _triad("rad/s"), {}, _BODY, _INERTIAL),
    "accelerometer": Kind((_AXES,), _triad("m/s^2"), {}, _BODY, (*_INERTIAL, "lever_arm")),
    "magnetometer": Kind(
        (_AXES,), _triad("T"), {}, _BODY, ("mounting", *_AIDING, "declination", "calibration")
    ),
    "compass": Kind((("psi",),), {"psi": "rad"}, {"psi": 0.05}, _EARTH, (*_AIDING, "declination")),
    "pressure": Kind(
        (("pressure",),), {"pressure": "Pa"}, {"pressure": 1000.0}, (),
        (*_AIDING, "lever_arm", "density", "latitude", "offset"),
    ),
    "depth": Kind((("depth",),), {"depth": "m"}, {"depth": 0.1}, (), (*_AIDING, "lever_arm")),
    "dvl": Kind((("u", "v", "w"),), dict.fromkeys("uvw", "m/s"), dict.fromkeys("uvw", 0.01), _BODY,
                (*_AIDING, "mounting", "lever_arm")),
    "gps": Kind(
        (("latitude", "longitude"), ("latitude", "longitude", "altitude"), ("x", "y"), _AXES), _FIX_UNITS, _FIX_SIGMA,
        _EARTH, (*_AIDING, "lever_arm", "origin"),
    ),
    "usbl": Kind((_AXES, ("x", "y")), _triad("m"), _triad(1.0), _EARTH, (*_AIDING, "lever_arm")),
    "velocity": Kind((_AXES, ("x", "y")), _triad("m/s"), _triad(0.1), _EARTH, (*_AIDING, "lever_arm")),
    "range": Kind((("range",),), {"range": "m"}, {"range": 0.5}, (), (*_AIDING, "lever_arm", "beacon")),
}  # fmt: skip
RULES = ("constant", "consistent", "fuzzy", "sage-husa", "innovation")


@dataclasses.dataclass(frozen=True)
class Sensor:
    """A sensor as its table in the file has it, SI.

    **Fields**

    - `name`: of its table. `kind`: one of `KINDS`. `channels`: what it measures; `columns`: of the log, one for each.
    - `unit`: of the columns where the log states none, by channel.
    - `frame`: of its axes, such as `FLU`; `mounting`: rows of the rotation from the sensor's axes to the body's.
    - `lever_arm`: m, from the origin of the body's axes. `sigma`: by channel, standard deviations of the noise.
    - `correlation`: s for which an error lasts. `delay`: s by which readings are older than their time stamps;
      `delay_std`: s, its standard deviation, zero where it is known.
    - `rate`: Hz at which it measures at most; zero where each sample is a measurement.
    - `noise`: of an inertial sensor. `range`: where it is at its stop, SI.
    - `sampling`: of an inertial sensor, whether a reading is that at its time, `point`, or the mean since the one
      before, `mean`.
    - `declination`: rad, magnetic north east of true north. `calibration`: of a magnetometer from the log.
    - `density` (kg/m³), `latitude` (rad) and `offset` (Pa): by which depth follows from pressure.
    - `origin`: latitude and longitude (rad) where x and y are zero, the first fix where None. `beacon`: m, NED.
    """

    name: str
    kind: str
    channels: tuple[str, ...]
    columns: tuple[str, ...]
    unit: tuple[str, ...]
    frame: str = ""
    mounting: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    lever_arm: Vector = (0.0, 0.0, 0.0)
    sigma: tuple[float, ...] = ()
    correlation: float = 0.0
    delay: float = 0.0
    delay_std: float = 0.0
    rate: float = 0.0
    noise: Grade | None = None
    range: float = math.inf
    sampling: str = "point"
    declination: float = 0.0
    calibration: str = "none"
    density: float | None = None
    latitude: float | None = None
    offset: float = 0.0
    origin: tuple[float, float] | None = None
    beacon: Vector = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Motion:
    """What is known of a motion beforehand: how far it goes and how fast, as standard deviations that last a time.

    **Fields**

    - `reach`: m, about the origin; `reach_time`: s. `speed`: m/s; `speed_time`: s. Infinite where unknown.
    """

    reach: float = math.inf
    reach_time: float = 1.0
    speed: float = math.inf
    speed_time: float = 10.0


@dataclasses.dataclass(frozen=True)
class SensorSuite:
    """All sensors of a vehicle.

    **Fields**

    - `name`: of the vehicle. `sensors`: in the file's order, a gyro and an accelerometer among them.
    - `rule`: of the process noise, one of `RULES`. `motion`: what is known beforehand.
    - `source`: the file, for messages.
    """

    name: str
    sensors: tuple[Sensor, ...]
    rule: str = RULES[0]
    motion: Motion = Motion()
    source: str = "sensors"

    def only(self, kind: str) -> Sensor:
        """The one sensor of a `kind` that every suite has one of."""
        return next(sensor for sensor in self.sensors if sensor.kind == kind)

    def of(self, *kinds: str) -> tuple[Sensor, ...]:
        """The sensors of these kinds."""
        return tuple(sensor for sensor in self.sensors if sensor.kind in kinds)

    @property
    def aiding(self) -> tuple[Sensor, ...]:
        """The sensors beside gyros and accelerometers."""
        return tuple(sensor for sensor in self.sensors if sensor.kind not in ("gyro", "accelerometer"))
