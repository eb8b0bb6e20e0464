"""Recordings as Parquet files."""

from pathlib import Path

import numpy as np
import pyarrow

from jaxsub.errors import InputError
from jaxsub.recording.bounds import require_plausible
from jaxsub.recording.frames import Table
from jaxsub.recording.reading import Contents, reading

_WIDEST = 8  # bytes of a sample


def read_parquet(path: Path, source: str) -> Contents:
    """The columns of a Parquet file."""
    from pyarrow import parquet

    with reading(source, "Parquet"), parquet.ParquetFile(path) as file:
        held = file.metadata
        groups = sum(held.row_group(i).total_byte_size for i in range(held.num_row_groups))
        claimed = max(_WIDEST * held.num_rows * held.num_columns, groups)
        require_plausible(source, claimed, path.stat().st_size)
        table = file.read()
        names = zip(table.column_names, table.columns, strict=True)
        columns: Table = [(name, _samples(source, name, column)) for name, column in names]
    return Contents(columns)


def _samples(source: str, name: str, column: pyarrow.ChunkedArray) -> np.ndarray | InputError:
    try:
        return column.to_numpy()
    except (pyarrow.ArrowException, ValueError, TypeError):
        what = f"holds {column.type} data"
        return InputError(f"{source}, column {name!r}", what, "give one number a sample or leave the column out")
