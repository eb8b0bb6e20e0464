"""What the keys of an actuator's table may say."""

import dataclasses
import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import UnknownUnit, same_dimension, split_header, to_si
from ..schema import Table, read_finite, read_positive

# abscissae, ordinates
Curve = tuple[tuple[float, ...], tuple[float, ...]]
_FEWEST = 2
_MOST = 1000


@dataclasses.dataclass(frozen=True)
class Key:
    """A key, its SI unit, and whether a table has to have it."""

    unit: str = ""
    required: bool = False


@dataclasses.dataclass(frozen=True)
class Number(Key):
    """A number that a fit may move."""

    positive: bool = False


@dataclasses.dataclass(frozen=True)
class Pair(Key):
    """Two numbers that a fit may move; one given alone is both, the first by `sign`."""

    labels: tuple[str, str] = ("low", "high")
    sign: int = 1


@dataclasses.dataclass(frozen=True)
class Function(Key):
    """A polynomial as the list of its coefficients, which a fit may move, or a table of points.

    `columns` are the names of abscissa and ordinate; `units` their SI units, empty where any may be.
    """

    columns: tuple[str, str] = ("x", "y")
    units: tuple[str, str] = ("", "")

    def points(self, table: Table, key: str, folder: Path) -> Curve:
        """The points of `key = { x = [...], y = [...] }`, or of the file that `key` names in `folder`."""
        place = table.place(key)
        if isinstance(table.data[key], str):
            x, y = self._file(table.data[key], place, folder)
        else:
            own = table.table(key)
            own.only(self.columns)
            x, y = (self._column(own.required(name), own.place(name)) for name in self.columns)
        if len(x) != len(y):
            raise InputError(place, f"has {len(x)} {self.columns[0]} and {len(y)} {self.columns[1]}", "give as many")
        if not _FEWEST <= len(x) <= _MOST:
            raise InputError(place, f"has {len(x)} points", f"give {_FEWEST} to {_MOST}")
        if not all(a < b for a, b in itertools.pairwise(x)):
            raise InputError(place, f"{self.columns[0]} does not increase", "sort the points, each once")
        return x, y

    def _column(self, values: Any, place: str) -> tuple[float, ...]:
        if not isinstance(values, list):
            raise InputError(place, f"{values!r:.60} is not a list", "give a list of numbers")
        return tuple(read_finite(value, place) for value in values)

    def _file(self, name: str, place: str, folder: Path) -> Curve:
        path = folder / name
        if not path.is_file():
            raise InputError(place, f"{str(path)!r:.200} is no file", "give a CSV file beside this one")
        try:
            rows = [line.split(",") for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
        except (OSError, ValueError) as error:
            raise InputError(place, f"{str(path)!r:.200} cannot be read", "give a CSV file in UTF-8") from error
        heads = [split_header(head) for head in rows[0]] if rows else []
        found = []
        for column, unit in zip(self.columns, self.units, strict=True):
            place_in = f"{path}, column {column!r}"
            at = next((i for i, (head, _) in enumerate(heads) if head == column), None)
            if at is None:
                raise InputError(str(path), f"has no column {column}", f"head one {column}[{unit or 'unit'}]")
            found.append(_numbers([row[at] if at < len(row) else "" for row in rows[1:]], heads[at][1], unit, place_in))
        return found[0], found[1]


@dataclasses.dataclass(frozen=True)
class Vector(Key):
    """Three plain numbers; a `direction` is made one of unit length."""

    default: tuple[float, float, float] | None = None
    direction: bool = False

    def read(self, entry: Any, place: str) -> tuple[float, float, float]:
        """The vector."""
        if not isinstance(entry, list) or len(entry) != 3:
            raise InputError(place, f"is {entry!r:.60}", "give three numbers")
        x, y, z = (read_finite(value, place) for value in entry)
        if not self.direction:
            return x, y, z
        if not (size := math.hypot(x, y, z)):
            raise InputError(place, "has no length", "give a direction such as [1, 0, 0]")
        if abs(size - 1.0) < 1e-12:  # so that what was written is read back to the last digit
            return x, y, z
        return x / size, y / size, z / size


@dataclasses.dataclass(frozen=True)
class Word(Key):
    """One of some words or, where there are none, the name of another actuator."""

    words: tuple[str, ...] = ()
    default: str = ""

    def read(self, table: Table, key: str) -> str:
        """The word."""
        return table.choice(key, self.words) if self.words else table.word(key)


@dataclasses.dataclass(frozen=True)
class Flag(Key):
    """True or false."""

    default: bool = True

    def read(self, entry: Any, place: str) -> bool:
        """The flag."""
        if not isinstance(entry, bool):
            raise InputError(place, f"is {entry!r:.60}", "write true or false")
        return entry


def read_limits(entry: Any, place: str) -> tuple[float, float]:
    """Least and largest command, of two numbers or one for both directions."""
    if not isinstance(entry, list):
        largest = read_positive(entry, place)
        return -largest, largest
    if len(entry) != 2:
        raise InputError(place, f"is {entry!r:.60}", "write limits = [low, high]")
    low, high = (read_finite(value, place) for value in entry)
    if not low < high:
        raise InputError(place, f"is {entry!r:.60}", "write limits = [low, high]")
    return low, high


def _numbers(cells: list[str], stated: str | None, unit: str, place: str) -> tuple[float, ...]:
    try:
        if stated and unit and not same_dimension(stated, unit):
            raise InputError(place, f"is in {stated}", f"give it in {unit} or another unit of that dimension")
        values = np.array([float(cell) for cell in cells])
        return tuple(read_finite(float(value), place) for value in to_si(values, stated or unit))
    except UnknownUnit as error:
        raise InputError(place, str(error), error.remedy) from error
    except InputError:
        raise
    except ValueError as error:
        raise InputError(place, "holds what is no number", "give a number in every row") from error
