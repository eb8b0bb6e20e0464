"""Columns of a recording as inputs and outputs of a vehicle that is begun."""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np

from ...effects import CHANNEL_UNITS
from ...errors import InputError
from ...recording import Recording
from ...units import si_unit

# of channels that say the same, the first that there is
_SAME = (("z", "depth"), ("r", "heading_rate"), ("u", "speed"), ("w", "depth_rate"))
_SAID_OF_ANY = ("", "cmd", "command", "setpoint", "sp", "ref", "demand", "pwm", "angle", "deg", "rad", "value")
# of a usual suite: Doppler log, MEMS gyros, attitude, pressure depth
_SIGMAS = {
    **dict.fromkeys("uvw", 0.01), **dict.fromkeys("pqr", 0.0035), "phi": 0.005, "theta": 0.005, "psi": 0.005, "z": 0.05
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Command:
    """A column that commands something: its name, its SI unit (empty where the file states none), its values."""

    column: str
    unit: str
    values: np.ndarray

    @property
    def largest(self) -> float:
        """Largest absolute value, 1 where there is none."""
        return float(np.nanmax(np.abs(self.values), initial=0.0)) or 1.0

    @property
    def toml(self) -> str:
        """As an input of any unit."""
        return f'{{ column = "{self.column}", unit = "{self.unit or 1}" }}'


class Columns:
    """The columns of a log as they are taken by one part of a vehicle after the other; without one, a usual suite."""

    def __init__(self, log: Recording | None) -> None:
        self.log = log
        self._left = [] if log is None else [name for name in log.columns if name not in CHANNEL_UNITS]

    def take(self, words: str, units: Sequence[str], stated: bool = False) -> Command | None:
        """The first column left whose name is one of `words`, a pattern, and whose unit is one of `units`.

        None in a log without such a column. `units` are SI, any where there are none; a unit that the log does not
        state is SI, unless it has to be `stated`.
        """
        for name in self._left:
            if re.fullmatch(words, _plain(name)) and (found := self._command(name, units, stated)):
                return found
        return None

    def named(self, names: Sequence[str], units: Sequence[str]) -> Command | None:
        """The first of the columns `names` that is left, as `take` has it."""
        there = (self._command(name, units) for name in names if name in self._left)
        return next((command for command in there if command), None)

    def _command(self, name: str, units: Sequence[str], stated: bool = False) -> Command | None:
        assert self.log is not None
        unit = self.log.units.get(name, "")
        if units and (unit or stated) and unit not in [si_unit(one) or "1" for one in units]:
            return None
        self._left.remove(name)
        return Command(name, unit, self.log.columns[name])

    def outputs(self, moved: Sequence[str]) -> list[tuple[str, str]]:
        """Measured channels among those `moved`, each with its noise as TOML."""
        if self.log is None:
            return [(channel, repr(sigma)) for channel, sigma in _SIGMAS.items() if channel in moved]
        found = [name for name in self.log.columns if name in moved and self._fits(name)]
        if not found:
            what = f"has none of the channels {', '.join(moved)}"
            raise InputError(self.log.source, what, "head a column r[deg/s] and the like, or give --columns")
        extra = {channel for basic, channel in _SAME if basic in found}
        self._left += [name for name in self.log.columns if name in CHANNEL_UNITS and name not in found]
        return [(name, '"estimate"') for name in found if name not in extra]

    @property
    def left(self) -> list[str]:
        """Columns of the log that nothing took."""
        return self._left

    def _fits(self, channel: str) -> bool:
        assert self.log is not None
        unit = self.log.units.get(channel, "")
        return not unit or unit == si_unit(CHANNEL_UNITS[channel])


def _plain(name: str) -> str:
    """A column's name in small letters, without words that say how it is known."""
    parts = re.split(r"[^a-z0-9]+", name.lower())
    return "_".join(part for part in parts if part not in _SAID_OF_ANY)
