"""Columns of a recording as inputs and outputs of a vehicle that is begun."""

import dataclasses
import json
import re
from collections.abc import Sequence

import numpy as np

from ...effects import CHANNEL_UNITS
from ...errors import InputError
from ...recording import Recording
from ...units import si_unit
from ..usual_sensors import SIGMAS

# of channels that say the same, the first that there is
_SAME = (("z", "depth"), ("r", "heading_rate"), ("u", "speed"), ("w", "depth_rate"))
_SAID_OF_ANY = ("", "cmd", "command", "setpoint", "sp", "ref", "demand", "pwm", "angle", "deg", "rad", "value")
# names that channels have elsewhere
_MEANT = {
    "roll": "phi", "pitch": "theta", "yaw": "psi", "heading": "psi", "roll_rate": "p", "pitch_rate": "q",
    "yaw_rate": "r", "surge": "u", "sway": "v", "heave": "w", "north": "x", "east": "y", "down": "z", "gyro_x": "p",
    "gyro_y": "q", "gyro_z": "r", "acc_x": "ax", "acc_y": "ay", "acc_z": "az", "vx": "u", "vy": "v", "vz": "w",
}  # fmt: skip
_LISTED = 20  # columns that a line names
# names of a shaft speed's column, a pattern
SHAFT = "n|rpm|rps|shaft|shaft_speed|prop|propeller|propeller_speed"


@dataclasses.dataclass(frozen=True)
class Command:
    """A column that commands something: its name, its SI unit (empty where the file states none), its values."""

    column: str
    unit: str
    values: np.ndarray

    @property
    def largest(self) -> float:
        """Largest absolute value, 1 where there is none."""
        return float(np.max(np.abs(self.there), initial=0.0)) or 1.0

    @property
    def there(self) -> np.ndarray:
        """The samples that are not missing."""
        return self.values[np.isfinite(self.values)]

    @property
    def toml(self) -> str:
        """As an input of any unit."""
        return f'{{ column = {quoted(self, "")}, unit = "{self.unit or 1}" }}'


class Columns:
    """The columns of a log as they are taken by one part of a vehicle after the other; without one, a usual suite."""

    def __init__(self, log: Recording | None) -> None:
        self.log = log
        self.left = [] if log is None else [name for name in log.columns if name not in CHANNEL_UNITS]

    def take(self, words: str, units: Sequence[str], stated: bool = False) -> Command | None:
        """The first column left whose name is one of `words`, a pattern, and whose unit is one of `units`.

        None in a log without such a column. `units` are SI, any where there are none; a unit that the log does not
        state is SI, unless it has to be `stated`.
        """
        for name in self.left:
            if re.fullmatch(words, _plain(name)) and (found := self._command(name, units, stated)):
                return found
        return None

    def named(self, names: Sequence[str], units: Sequence[str]) -> Command | None:
        """The first of the columns `names` that is left, as `take` has it."""
        there = (self._command(name, units) for name in names if name in self.left)
        return next((command for command in there if command), None)

    def _command(self, name: str, units: Sequence[str], stated: bool = False) -> Command | None:
        assert self.log is not None
        unit = self.log.units.get(name, "")
        if units and (unit or stated) and unit not in [si_unit(one) or "1" for one in units]:
            return None
        self.left.remove(name)
        return Command(name, unit, self.log.columns[name])

    def put_back(self, commands: Sequence[Command | None]) -> None:
        """Leave `commands` that were taken to others."""
        self.left += [command.column for command in commands if command is not None]

    def outputs(self, moved: Sequence[str]) -> list[tuple[str, str]]:
        """Measured channels among those `moved`, each with its noise as TOML."""
        if self.log is None:
            return [(channel, repr(sigma)) for channel, sigma in SIGMAS.items() if channel in moved]
        found = [name for name in self.log.columns if name in moved and self._fits(name)]
        if not found:
            what = f"has none of the channels {', '.join(moved)}"
            raise InputError(self.log.source, what, "head a column r[deg/s] and the like, or give --columns")
        extra = {channel for basic, channel in _SAME if basic in found}
        used = [name for name in found if name not in extra]
        self.left += [name for name in self.log.columns if name in CHANNEL_UNITS and name not in used]
        return [(name, '"estimate"') for name in used]

    @property
    def said_of_left(self) -> str:
        """The columns left as a line, with the channels that some seem to be."""
        guessed = {name: _MEANT.get(_plain(name), "") for name in self.left}
        said = [
            f"{_shown(name)}{f' (name it {channel} if it is)' if channel else ''}" for name, channel in guessed.items()
        ]
        more = [f"{len(said) - _LISTED} more"] if len(said) > _LISTED else []
        return ", ".join([*said[:_LISTED], *more])

    def _fits(self, channel: str) -> bool:
        assert self.log is not None
        unit = self.log.units.get(channel, "")
        return not unit or unit == si_unit(CHANNEL_UNITS[channel])


def quoted(command: Command | None, usual: str) -> str:
    """The name of a command's column as TOML, the `usual` one where there is no command."""
    return json.dumps(command.column if command else usual, ensure_ascii=False)


def _shown(name: str) -> str:
    """A column's name on one line."""
    return name if name.isprintable() else repr(name)


def _plain(name: str) -> str:
    """A column's name in small letters, without words that say how it is known."""
    parts = re.split(r"[^a-z0-9]+", name.lower())
    return "_".join(part for part in parts if part not in _SAID_OF_ANY)
