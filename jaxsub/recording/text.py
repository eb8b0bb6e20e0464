"""Recordings as text: CSV and its dialects."""

import csv
import itertools
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow
from pyarrow import csv as arrow

from jaxsub.errors import InputError
from jaxsub.recording.dialect import Dialect, find_dialect
from jaxsub.recording.layout import Layout, find_layout, is_blank, is_comment, row_error
from jaxsub.recording.numbers import Cell, Column, Instants
from jaxsub.recording.reading import Contents, note, reading
from jaxsub.units import TIME, split_header

_CHUNK = 4096  # rows
_BLOCK = 2**22  # bytes


def read_text(path: Path, source: str) -> Contents:
    """The columns of a file of text, and a note that says how it is read unless it is plain CSV."""
    with reading(source, "UTF-8 text"):
        dialect = find_dialect(path, source)
        layout = find_layout(dialect.rows, dialect.top, dialect.commented, dialect.separator)
        columns = quick_columns(path, dialect, layout)
        if columns is None:
            columns = careful_columns(path, source, dialect, layout)
    return contents(source, columns, layout, dialect.said)


def quick_columns(path: Path, dialect: Dialect, layout: Layout) -> list[Column] | None:
    """The columns as pyarrow reads them, the same numbers as `careful_columns`, or nothing for other than plain rows.

    A column that holds no numbers in the first rows is not read at all.
    """
    if not dialect.lines or not layout.decimal:
        return None
    try:
        known = tabulate(dialect.rows[layout.first_row - dialect.top :], "", layout)
    except InputError:
        return None  # to be named by the careful reader
    wanted = {i: layout.empty(known[i]) for i in range(len(known)) if known[i].header and known[i].error is None}
    names = [str(index) for index in range(layout.cells)]
    types = {names[i]: pyarrow.string() if isinstance(c, Instants) else pyarrow.float64() for i, c in wanted.items()}
    types |= {names[i]: pyarrow.null() for i in range(len(known), layout.cells)}
    how = (
        arrow.ReadOptions(
            column_names=names,
            skip_rows=layout.first_row - 1,
            encoding=dialect.encoding.replace("-sig", ""),
            block_size=_BLOCK,
        ),
        arrow.ParseOptions(delimiter=dialect.separator),
        arrow.ConvertOptions(
            column_types=types,
            include_columns=list(types),
            null_values=["", "nan", "NaN"],
            decimal_point=layout.decimal,
        ),
    )
    row = layout.first_row
    try:
        with arrow.open_csv(path, *how) as batches:
            for batch in batches:
                for index, column in wanted.items():
                    cells = batch.column(names[index])
                    if isinstance(column, Instants):
                        column.add(tuple(cells.to_pylist()), row)
                    else:
                        column.take(_floats(cells))
                row += batch.num_rows
    except (pyarrow.ArrowException, ValueError, OSError):
        return None
    finally:
        # blocks that were read ahead: 0.1 GB of a long file
        pyarrow.default_memory_pool().release_unused()
    # a blank row, a comment or a line break within a cell, and what only the careful reader may refuse
    if row != dialect.lines + 1 or any(column.error is not None for column in wanted.values()):
        return None
    if any(_is_time(column) and _missing(column.samples("")) for column in wanted.values()):
        return None
    return [wanted.get(index, column) for index, column in enumerate(known)]


def _floats(cells: pyarrow.DoubleArray) -> np.ndarray:
    """The numbers of a batch's column, NaN where there is none; Arrow's own conversion imports pandas first."""
    valid, numbers = cells.buffers()
    after = cells.offset + len(cells)
    values = np.frombuffer(numbers, np.float64, after)[cells.offset :].copy()
    if valid is not None:
        known = np.unpackbits(np.frombuffer(valid, np.uint8), count=after, bitorder="little")[cells.offset :]
        values[known == 0] = np.nan
    return values


def _missing(values: np.ndarray | InputError) -> bool:
    return isinstance(values, np.ndarray) and bool(np.isnan(values).any())


def careful_columns(path: Path, source: str, dialect: Dialect, layout: Layout) -> list[Column]:
    """The columns, cell by cell. Raises InputError for a row that has not a cell for each header."""
    with path.open(encoding=dialect.encoding, newline="") as file:
        lines = itertools.islice(file, dialect.top - 1, None)
        rows = csv.reader(lines, delimiter=dialect.separator, skipinitialspace=True)
        return tabulate(itertools.islice(rows, layout.first_row - dialect.top, None), source, layout)


def tabulate(rows: Iterable[Sequence[Cell]], source: str, layout: Layout) -> list[Column]:
    """The columns of rows of cells; blank rows and comments may follow the last one.

    Raises InputError for a row that has not a cell for each header.
    """
    columns = layout.columns()
    row = layout.first_row
    for chunk in _chunks(_samples(rows, source, layout), _CHUNK):
        for column, cells in zip(columns, zip(*chunk, strict=True), strict=False):
            if column.header:
                column.add(cells, row)
        row += len(chunk)
    return columns


def contents(source: str, columns: list[Column], layout: Layout, said: Iterable[str] = ()) -> Contents:
    """What a reader hands over, with its notes."""
    table, notes = [], []
    if how := [*said, *layout.said]:
        notes.append(note(source, "dialect", f"is read with {', '.join(how)}"))
    for column in columns:
        if not column.header:
            continue
        values = column.samples(source)
        table.append((column.header, values))
        if isinstance(values, np.ndarray):
            notes += [note(source, "spelling", what, column.header, count) for what, count in column.odd.items()]
    return Contents(table, tuple(notes), layout.first_row)


def _samples(rows: Iterable[Sequence[Cell]], source: str, layout: Layout) -> Iterator[Sequence[Cell]]:
    """The rows that are samples. Raises InputError for one that is none, unless only such follow."""
    skipped, width = None, len(layout.headers)
    for row, cells in enumerate(rows, layout.first_row):
        if (is_blank(cells[:1]) and is_blank(cells)) or is_comment(cells):
            skipped = skipped or (row, cells)
            continue
        if skipped:
            raise row_error(source, *skipped, layout)
        if len(cells) != layout.cells or not is_blank(cells[width:]):
            raise row_error(source, row, cells, layout)
        yield cells


def _chunks(rows: Iterator[Sequence[Cell]], size: int) -> Iterator[list[Sequence[Cell]]]:
    while chunk := list(itertools.islice(rows, size)):
        yield chunk


def _is_time(column: Column) -> bool:
    return split_header(column.header)[0] == TIME
