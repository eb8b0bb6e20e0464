"""A measured column of a recording: which channel of the motion it shows, and in which form."""

import dataclasses
import math
from collections.abc import Sequence

from ...effects import CHANNEL_UNITS

# channels of a submerged body that only instruments have, with their SI units
RAW_UNITS: dict[str, str] = {"pressure": "Pa", "beam": "m/s", "latitude": "rad", "longitude": "rad"}
VELOCITY, TURNING, SPECIFIC_FORCE = ("u", "v", "w"), ("p", "q", "r"), ("ax", "ay", "az")
TRIADS = (VELOCITY, TURNING, SPECIFIC_FORCE)
POSITION, GEODETIC = ("x", "y", "z", "depth"), ("latitude", "longitude")
ANGLES = ("phi", "theta", "psi")
# what each channel in axes east, north and up is in those north, east and down: channel, sign, constant
_ENU = {
    "x": ("y", 1.0, 0.0), "y": ("x", 1.0, 0.0), "z": ("z", -1.0, 0.0),
    "phi": ("phi", 1.0, 0.0), "theta": ("theta", -1.0, 0.0), "psi": ("psi", -1.0, 0.5 * math.pi),
}  # fmt: skip
# the same for axes forward, left and up
_FLU = {c: (c, -1.0 if c in ("v", "w", "q", "r", "ay", "az") else 1.0, 0.0) for triad in TRIADS for c in triad}
FRAMES: dict[str, dict[str, tuple[str, float, float]]] = {"ENU": _ENU, "FLU": _FLU}
WRAPS: dict[str, float] = {"0-360": 0.0, "+-180": -math.pi}  # where the turn begins, rad
# states that a channel shows by another name or in another form
_STATES = {"depth": "z", "pressure": "z", "latitude": "x", "longitude": "y"}
Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Output:
    """A measured column: what it measures, where its sensor sits, and how it is written.

    **Fields**

    - `channel`: of the motion, such as `u`, `psi` or `pressure`.
    - `sigma`: 1-σ noise in the column's SI unit; None where it is to be estimated.
    - `lever_arm`: from the origin of the body's axes to the sensor, m.
    - `name`: of the output, by default the channel. `column`: of the recording, by default the name.
    - `unit`: SI unit of the column where it is not the channel's.
    - `frame`: `ENU` of a position or attitude, `FLU` of a motion in body axes; empty for NED and FRD.
    - `wrap`: the turn within which a heading is written, one of `WRAPS`; empty where whole turns are counted.
    - `instrument`: the table that has several outputs, empty for one by itself.
    - `direction`: of a beam, a unit vector in the axes of its instrument.
    - `density` (kg/m³) or `latitude` (rad): by which pressure follows from depth; neither: the body's density.
    - `origin`: latitude and longitude (rad) where x and y are zero.
    """

    channel: str
    sigma: float | None = None
    lever_arm: Vector = STILL
    name: str = ""
    column: str = ""
    unit: str = ""
    frame: str = ""
    wrap: str = ""
    instrument: str = ""
    direction: Vector = STILL
    density: float | None = None
    latitude: float | None = None
    origin: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self):
        object.__setattr__(self, "name", self.name or self.channel)
        object.__setattr__(self, "column", self.column or self.name)

    @property
    def table(self) -> str:
        """The table of the vehicle file that has it."""
        return self.instrument or self.name

    @property
    def framed(self) -> tuple[str, float, float]:
        """The channel c, sign s and constant k (rad) of which it shows s c + k, c in axes NED or FRD."""
        return FRAMES[self.frame][self.channel] if self.frame else (self.channel, 1.0, 0.0)

    @property
    def state(self) -> str:
        """The state that it shows but for its form, scale, offset and arm, if it shows one."""
        channel, _, _ = self.framed
        return _STATES.get(channel, channel)


def quantities_of(outputs: Sequence[Output], body: bool) -> dict[str, str]:
    """By channel what each of `outputs` shows whose name does not say it, as `Facts.quantities` has it.

    `body` says whether the vehicle is a body, else it is a mechanism.
    """
    found = {}
    for output in outputs:
        motion, sign, _ = output.framed
        unit = output.unit or (channel_unit(motion) if body else "")
        if output.name != motion or sign < 0.0 or output.unit:
            found[output.name] = f"{'-' * (sign < 0.0)}{motion}[{unit}]"
    return found


def channel_unit(channel: str) -> str:
    """SI unit of a submerged body's channel; nothing for what is none."""
    return CHANNEL_UNITS.get(channel) or RAW_UNITS.get(channel, "")
