"""Where in rows of cells the headers, the units and the samples stand."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from jaxsub.errors import InputError
from jaxsub.recording.numbers import DOUBTFUL, NUMBER, Cell, Column, Instants, instant
from jaxsub.units import TIME, UnknownUnit, si_unit, split_header

COMMENTS = ("#", "%", "//")
_PARENTHESES = re.compile(r"(.*\S)\s*\(([^()]+)\)")


class Layout(NamedTuple):
    """How a table of cells is laid out.

    **Fields**

    - `headers`: of each column, empty for one that is left out.
    - `first_row`: the row of the first sample.
    - `cells`: how many cells each row has; one more than headers where rows end with a separator.
    - `decimal`: the mark before decimals; `instants`: whether times are ISO 8601 instants.
    - `said`: how the table is read, where that has to be stated.
    """

    headers: tuple[str, ...]
    first_row: int
    cells: int
    decimal: str
    instants: bool
    said: tuple[str, ...]

    def columns(self) -> list[Column]:
        """An empty column under each header."""
        kind = lambda header: Instants if self.instants and split_header(header)[0] == TIME else Column
        return [kind(header)(header, self.decimal) for header in self.headers]

    def empty(self, column: Column) -> Column:
        """An empty column like `column`."""
        return type(column)(column.header, self.decimal)


def find_layout(
    rows: Sequence[Sequence[Cell]], top: int, commented: Sequence[str] | None = None, separator: str = ","
) -> Layout:
    """The layout of a table whose first `rows` begin at row `top`.

    `commented` has the cells of a comment line above them, which are the headers if the first row holds numbers only.
    `separator` stands between the cells.
    """
    said = []
    header, index = [str(cell).strip() for cell in rows[0]], 1
    if commented and len(commented) == len(header) and all(_is_number(cell) for cell in rows[0]):
        header, index = [cell.strip() for cell in commented], 0
        said.append("headers from the comment above the first row")
    index = _skip(rows, index)
    headers = [with_brackets(text) for text in header]
    if headers != header:
        said.append("units in parentheses")
    if index < len(rows) and (stated := _units(headers, rows[index])):
        headers = stated
        said.append(f"units from row {top + index}")
        index = _skip(rows, index + 1)
    body = [row for row in rows[index:] if not is_blank(row)]
    cells = len(header)
    if body and len(body[0]) == cells + 1 and is_blank(body[0][cells:]):
        cells += 1
        said.append("a separator at the end of each row")
    said += [f"column {i} left out, which has no header" for i, name in enumerate(headers, 1) if not name]
    decimal = _decimal(body, separator)
    if decimal == ",":
        said.append("decimal commas")
    at = next((i for i, name in enumerate(headers) if split_header(name)[0] == TIME), None)
    instants = at is not None and bool(body) and at < len(body[0]) and instant(body[0][at]) is not None
    if instants:
        said.append("times as ISO 8601 instants, in s from the first")
    return Layout(tuple(headers), top + index, cells, decimal, instants, tuple(said))


def with_brackets(header: str) -> str:
    """`name[unit]` for a header `name (unit)`, and any other header as it is."""
    found = _PARENTHESES.fullmatch(header)
    if found is None or "[" in header or not _is_unit(found[2]):
        return header
    return f"{found[1]}[{found[2].strip()}]"


def is_blank(cells: Sequence[Cell]) -> bool:
    """Whether every cell is blank."""
    return all(isinstance(cell, str) and not cell.strip() for cell in cells)


def is_comment(cells: Sequence[Cell]) -> bool:
    """Whether the row is a comment."""
    return bool(cells) and isinstance(cells[0], str) and cells[0].lstrip().startswith(COMMENTS)


def row_error(source: str, row: int, cells: Sequence[Cell], layout: Layout) -> InputError:
    """The error of a row that is no sample."""
    where = f"{source}, row {row}"
    if is_comment(cells):
        return InputError(where, "a comment between samples", "delete it, or move it above the headers")
    if len(cells) == layout.cells and is_blank(cells):
        return InputError(where, "a blank row between samples", "delete it")
    remedy = "give every row a cell for each header"
    if len(cells) > layout.cells and layout.decimal != ",":
        remedy += "; where commas stand before decimals, separate the cells by semicolons"
    return InputError(where, f"{len(cells)} cells under {len(layout.headers)} headers", remedy)


def _skip(rows: Sequence[Sequence[Cell]], index: int) -> int:
    while index < len(rows) and is_comment(rows[index]):
        index += 1
    return index


def _units(headers: list[str], row: Sequence[Cell]) -> list[str]:
    """The headers with the units that `row` states, none unless it states one of time under the header of time."""
    texts = [re.sub(r"^[\[(]|[\])]$", "", str(cell).strip()).strip() for cell in row]
    at = next((i for i, header in enumerate(headers) if split_header(header)[0] == TIME), None)
    if at is None or len(texts) < len(headers) or _is_number(row[at]) or not _is_unit(texts[at], "s"):
        return []
    stated = []
    for header, text in zip(headers, texts, strict=False):
        name, unit = split_header(header)
        text = "1" if text in ("-", "none") else text
        stated.append(header if not header or not text or unit == text else f"{name}[{text}]")
        if unit is not None and text and unit != text:
            stated[-1] = f"{name}[{unit} and {text}]"  # no unit, so that the column is rejected where it is used
    return stated


def _is_unit(text: str, of: str | None = None) -> bool:
    try:
        return bool(text.strip()) and si_unit(text.strip()) == (of or si_unit(text.strip()))
    except UnknownUnit:
        return False


def _is_number(cell: Cell) -> bool:
    return Column("").value(cell) is not None or Column("", ",").value(cell) is not None


def _decimal(rows: Sequence[Sequence[Cell]], separator: str) -> str:
    """The mark before decimals: a comma only where one cell proves it and no number has a point; empty where in doubt.

    Where semicolons stand between cells, 1.234 may be a thousand: there a point has to be proved too.
    """
    proved: dict[str, bool] = {}
    for row in rows:
        for cell in row:
            if not isinstance(cell, str) or ("." not in cell and "," not in cell):
                continue
            text = cell.strip()
            for mark in ".,":
                if NUMBER[mark].fullmatch(text):
                    proved[mark] = proved.get(mark, False) or not DOUBTFUL.fullmatch(text)
    if proved == {",": True}:
        return ","
    return "" if separator == ";" and proved == {".": False} else "."
