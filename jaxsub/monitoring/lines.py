"""Lines of CSV as they arrive, read as a vehicle's rows."""

import csv

import numpy as np
from jaxtyping import Float

from ..errors import InputError, suggestion
from ..recording.numbers import Column
from ..units import TIME, UnknownUnit, check_time_unit, column_unit, split_header, to_si
from ..vehicle import Layout


class Lines:
    """A reader of lines under a header, for the vehicle of a layout.

    A line that has not a cell for each header, or whose time is no number, is `malformed`, and counted; a cell that is
    blank or no number is a missing sample.

    **Raises** `InputError` for a header that lacks a column of the vehicle's, or has a unit that is none.
    """

    def __init__(self, header: str, layout: Layout, source: str):
        self.header, self.malformed = header.strip("\ufeff\r\n"), 0
        self._columns = [Column(cell.strip()) for cell in _cells(self.header)]
        units = dict(split_header(column.header) for column in self._columns)
        at = {split_header(column.header)[0]: i for i, column in enumerate(self._columns)}
        wanted = (TIME, *row_columns(layout))
        for name in wanted:
            if name not in at:
                remedy = suggestion(name, at, f"its columns are {', '.join(at) or 'none'}")
                raise InputError(f"{source}, header", f"has no column {name!r}", remedy)
        self._at = [at[name] for name in wanted]
        self._scale, self._offset = np.array([_line(source, name, units[name]) for name in wanted]).T

    def row(self, line: str) -> Float[np.ndarray, " w"] | None:
        """Time, signals and outputs (1 + m + c,) of a `line`, SI, NaN where missing; None of a bad one or a header."""
        if line.strip("\ufeff\r\n") == self.header:
            return None
        try:
            cells = _cells(line)
        except csv.Error:
            cells = []
        if len(cells) != len(self._columns):
            self.malformed += 1
            return None
        values = [self._columns[i].value(cells[i]) for i in self._at]
        if values[0] is None or np.isnan(values[0]):
            self.malformed += 1
            return None
        known = np.array([np.nan if value is None else value for value in values])
        return self._offset + self._scale * known


def row_columns(layout: Layout) -> tuple[str, ...]:
    """The columns of a row after its time: signals that are held, those interpolated, and outputs."""
    return (*layout.held, *layout.interpolated, *layout.columns)


def _cells(line: str) -> list[str]:
    return next(iter(csv.reader([line.rstrip("\r\n")], skipinitialspace=True)), [])


def _line(source: str, name: str, unit: str | None) -> tuple[float, float]:
    """Factor and offset from the `unit` of a column `name` to SI."""
    if unit is None:
        return 1.0, 0.0
    where = f"{source}, column {name!r}"
    try:
        if name == TIME:
            check_time_unit(where, unit)
        offset, one = to_si(np.array([0.0, 1.0]), column_unit(name, unit))
    except UnknownUnit as error:
        raise InputError(where, str(error), error.remedy) from error
    return float(one - offset), float(offset)
