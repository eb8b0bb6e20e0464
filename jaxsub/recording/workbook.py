"""Recordings as sheets of a workbook (.xlsx), read by python-calamine."""

import datetime
import re
import zipfile
from pathlib import Path
from typing import Any

from jaxsub.errors import InputError, optional
from jaxsub.recording.bounds import require_plausible
from jaxsub.recording.layout import find_layout, is_blank, is_comment
from jaxsub.recording.numbers import Cell
from jaxsub.recording.reading import Contents, reading
from jaxsub.recording.text import contents, tabulate
from jaxsub.units import TIME, split_header

_CELL = 24  # bytes that the reader takes for a cell, blank ones between others too
_PIECE = 2**20
_PLACE = re.compile(rb'<(?:\w+:)?c\b[^>]*?\br="([A-Z]{1,3})(\d{1,7})"')
_SAMPLE = 1000


def read_workbook(path: Path, source: str) -> Contents:
    """The columns of the only sheet, or of the only one that has a header `t`."""
    package = optional("python_calamine", "files", source)
    with reading(source, "an Excel workbook"):
        _check(path, source)
        with package.load_workbook(str(path)) as book:
            sheets = {name: _rows(book.get_sheet_by_name(name)) for name in book.sheet_names}
        filled = {name: rows for name, rows in sheets.items() if rows}
        if not filled:
            raise InputError(source, "is empty", "write a header and a row for each sample")
        timed = {name: rows for name, rows in filled.items() if len(filled) == 1 or _has_times(rows)}
        if len(timed) != 1:
            what = f"has {len(timed)} sheets with a header {TIME!r} of {', '.join(filled)}"
            raise InputError(source, what, "save the sheet of the run as a workbook or a .csv file of its own")
        name, rows = timed.popitem()
        said = [f"the sheet {name!r}"] if len(filled) > 1 else []
        top = _top(rows)
        layout = find_layout(rows[top : top + _SAMPLE], top + 1)
        columns = tabulate(iter(rows[layout.first_row - 1 :]), source, layout)
    return contents(source, columns, layout, said)


def _check(path: Path, source: str) -> None:
    """Raise InputError where the workbook expands to more than it plausibly holds, packed or as a grid."""
    size = path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        require_plausible(source, sum(member.file_size for member in archive.infolist()), size)
        cells = 0
        for member in archive.infolist():
            if "worksheets/" not in member.filename or not member.filename.endswith(".xml"):
                continue
            width = height = 0
            with archive.open(member) as sheet:
                rest = b""
                while piece := sheet.read(_PIECE):
                    piece = rest + piece
                    for letters, row in _PLACE.findall(piece):
                        width, height = max(width, _index(letters)), max(height, int(row))
                    rest = piece[piece.rfind(b"<") :][-200:]
            cells += width * height
        require_plausible(source, _CELL * cells, size)


def _index(letters: bytes) -> int:
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number


def _rows(sheet: Any) -> list[list[Cell]]:
    """The cells of a sheet from its first row on, without the blank rows at its end."""
    rows = [[_cell(value) for value in row] for row in sheet.to_python(skip_empty_area=False)]
    while rows and is_blank(rows[-1]):
        rows.pop()
    return rows


def _cell(value: Any) -> Cell:
    if isinstance(value, datetime.datetime):
        return value.isoformat()
    if isinstance(value, datetime.date):
        return f"{value.isoformat()}T00:00:00"
    if isinstance(value, bool | int | float):
        return float(value)
    if isinstance(value, datetime.timedelta):
        return value.total_seconds()
    return str(value)


def _top(rows: list[list[Cell]]) -> int:
    return next((i for i, row in enumerate(rows) if not is_blank(row) and not is_comment(row)), 0)


def _has_times(rows: list[list[Cell]]) -> bool:
    header = rows[_top(rows)]
    return any(isinstance(cell, str) and split_header(cell.partition("(")[0])[0] == TIME for cell in header)
