"""The columns of a vehicle's recordings that checks look at, and what each of them measures."""

import dataclasses
from typing import Literal

from ..vehicle import Layout

Role = Literal["held input", "prescribed", "measured"]
_ENVIRONMENT_UNITS = {"density": "kg/m³", "temperature": "K", "altitude": "m", "ballast": "m³", "current_north": "m/s",
                      "current_east": "m/s"}  # fmt: skip
# Euler angles, in which a whole turn makes no difference
ANGLES = ("phi", "theta", "psi")


@dataclasses.dataclass(frozen=True)
class Channel:
    """One column of a recording.

    **Fields**

    - `name`: of the column; `quantity`: what the vehicle calls it, such as `psi`, `rudder` or `density`; empty for
      a raw form of one.
    - `role`: a held input, a prescribed motion or surrounding (interpolated), or measured.
    - `unit`: SI, empty where the vehicle does not say, as a mechanism's.
    - `sigma`: 1-σ noise of a measured channel (SI), 0 where that is unknown.
    """

    name: str
    quantity: str
    role: Role
    unit: str
    sigma: float = 0.0


def channels_of(layout: Layout) -> tuple[Channel, ...]:
    """Every column that a vehicle of `layout` takes from a recording, once; as an input where it is measured too."""
    body = layout.kind == "submerged-body"
    found = [Channel(column, name, "held input", layout.input_unit(name)) for name, column in layout.inputs]
    found += [Channel(column, name, "prescribed", layout.unit(name)) for name, column in layout.prescribed]
    found += [
        Channel(column, name, "prescribed", _ENVIRONMENT_UNITS.get(name, "") if body else "")
        for name, column in layout.environment
    ]
    plain = layout.plain
    for output in layout.outputs:
        usual = plain.get(output.channel) == output.column or layout.is_angle(output.channel)
        quantity, unit = output.channel if usual else "", layout.unit(output.name)
        found.append(Channel(output.column, quantity, "measured", unit, output.sigma or 0.0))
    first: dict[str, Channel] = {}
    for channel in found:
        first.setdefault(channel.name, channel)
    return tuple(first.values())
