"""Numbers and instants in cells of text, read only where there is one way to read them."""

import datetime
import math
import re
from collections import Counter

import numpy as np

from jaxsub.errors import InputError

Cell = str | float

_BLANK = frozenset({"", "nan", "+nan", "-nan"})
_ABSENT = frozenset({"na", "n/a", "#n/a", "null", "none", "-", "--"})
_INFINITE = {f"{sign}{word}": float(f"{sign}inf") for sign in ("", "+", "-") for word in ("inf", "infinity")}
_INSTANT = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?\s?(Z|[+-]\d\d(?::?\d\d)?)?", re.ASCII
)
_EPOCH = datetime.datetime(1970, 1, 1)
_NANO = 10**9


def _number(decimal: str) -> re.Pattern[str]:
    point = re.escape(decimal)
    return re.compile(rf"[ \t]*[+-]?(?:\d+{point}?\d*|{point}\d+)(?:[eE][+-]?\d+)?[ \t]*", re.ASCII)


def _grouped(separator: str, decimal: str) -> re.Pattern[str]:
    """Numbers with thousands set apart that cannot be anything else: with decimals too, or with two groups."""
    mark, point = re.escape(separator), re.escape(decimal)
    return re.compile(rf"[+-]?\d{{1,3}}(?:(?:{mark}\d{{3}})+{point}\d+|(?:{mark}\d{{3}}){{2,}})", re.ASCII)


NUMBER = {decimal: _number(decimal) for decimal in ".,"}
_GROUPED = {".": _grouped(",", "."), ",": _grouped(".", ",")}
_APOSTROPHES = {mark: re.compile(rf"[+-]?\d{{1,3}}(?:['’]\d{{3}})+(?:[{mark}]\d+)?", re.ASCII) for mark in ".,"}
# 1,234 is a thousand, or one and a bit; 0,234 and 1,5 are no thousands
DOUBTFUL = re.compile(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)


class Column:
    """The samples of one column, taken in pieces; `error` is set at the first cell that holds no number.

    `decimal` is the mark before decimals, empty where that is in doubt. `odd` counts the cells that were read in a way
    that has to be stated.
    """

    def __init__(self, header: str, decimal: str = "."):
        self.header = header
        self.error: tuple[int, str, str] | None = None
        self.odd: Counter[str] = Counter()
        self._decimal = decimal or "."
        self._plain = NUMBER[decimal].fullmatch if decimal else re.compile(r"\s*[+-]?\d+\s*", re.ASCII).fullmatch
        self._pieces: list[np.ndarray] = []

    def add(self, cells: tuple[Cell, ...], row: int) -> None:
        """Take the cells of rows `row` and following."""
        if self.error is not None:
            return
        values = np.empty(len(cells))
        for index, cell in enumerate(cells):
            value = self.value(cell)
            if value is None:
                self.error = (row + index, *self._fault(str(cell)))
                return
            values[index] = value
        self._pieces.append(values)

    def take(self, values: np.ndarray) -> None:
        """Take numbers that were read elsewhere."""
        self._pieces.append(values)

    def samples(self, source: str) -> np.ndarray | InputError:
        """The numbers, float64, or the error that stands where they are used."""
        if self.error is None:
            return np.concatenate(self._pieces) if self._pieces else np.empty(0)
        row, what, remedy = self.error
        return InputError(f"{source}, row {row}, column {self.header!r}", what, remedy)

    def value(self, cell: Cell) -> float | None:
        """The number in a cell, NaN where it states none, or nothing where it cannot be read."""
        if not isinstance(cell, str):
            return float(cell)
        if self._plain(cell):
            return float(cell if self._decimal == "." else cell.replace(",", "."))
        text = cell.strip().lower()
        if text in _BLANK or re.fullmatch(r"[+-]?nan\(\w*\)", text):
            return math.nan
        if text in _INFINITE:
            return _INFINITE[text]
        if text in _ABSENT:
            self.odd[f"{cell.strip()!r} is read as missing"] += 1
            return math.nan
        for pattern, marks in ((_GROUPED[self._decimal], ",."), (_APOSTROPHES[self._decimal], "'’")):
            if pattern.fullmatch(text):
                self.odd[f"thousands are set apart, as in {cell.strip()!r}"] = 1
                bare = re.sub(f"[{marks.replace(self._decimal, '')}]", "", text)
                return float(bare.replace(self._decimal, "."))
        return None

    def _fault(self, cell: str) -> tuple[str, str]:
        shown = f"{cell!r:.60}"
        text = cell.strip()
        if DOUBTFUL.fullmatch(text):
            return f"{shown} may be a thousand or a fraction", "write decimal points and no mark between thousands"
        other = "," if self._decimal == "." else "."
        if NUMBER[other].fullmatch(text):
            here, there = ("comma", "points") if other == "," else ("point", "commas")
            return f"{shown} has a decimal {here} in a file of decimal {there}", "write all numbers in one way"
        return f"{shown} is not a number", "write a number or leave the cell blank"


class Instants(Column):
    """Times written as ISO 8601 instants, read as s from the first."""

    def __init__(self, header: str, decimal: str = "."):
        super().__init__(header, decimal)
        self._first: tuple[int, bool] | None = None

    def value(self, cell: Cell) -> float | None:
        """Seconds from the first instant; nothing unless all state a zone or none does."""
        found = instant(cell)
        if found is None:
            return None
        self._first = self._first or found
        return (found[0] - self._first[0]) / _NANO if found[1] == self._first[1] else None

    def _fault(self, cell: str) -> tuple[str, str]:
        remedy = "write every time like 2024-06-01T12:00:00.5, all with a zone or all without"
        return f"{cell!r:.60} is no instant like the first", remedy


def instant(cell: Cell) -> tuple[int, bool] | None:
    """Nanoseconds from 1970 and whether a zone is stated, of an ISO 8601 date with time; nothing for other text."""
    if not isinstance(cell, str) or not (found := _INSTANT.fullmatch(cell.strip())):
        return None
    *parts, fraction, zone = found.groups()
    try:
        year, month, day, hour, minute, second = (int(part or 0) for part in parts)
        moment = datetime.datetime(year, month, day, hour, minute, second)
    except ValueError:
        return None
    seconds = (moment - _EPOCH) // datetime.timedelta(seconds=1)
    if zone and zone != "Z":
        sign, digits = (-1 if zone[0] == "-" else 1), zone[1:].replace(":", "")
        seconds -= sign * 60 * (60 * int(digits[:2]) + int(digits[2:] or 0))
    return seconds * _NANO + int((fraction or "").ljust(9, "0")), zone is not None
