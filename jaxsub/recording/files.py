"""Recordings as CSV, Parquet and NetCDF files whose headers are `name` (SI) or `name[unit]`."""

import csv
import os
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np
import xarray
from pyarrow import parquet

from jaxsub.errors import InputError
from jaxsub.recording.frames import Table, recorded, to_pandas, to_xarray, variables
from jaxsub.recording.logs import SUFFIXES, Selection, load_log
from jaxsub.recording.recording import FIRST_ROW, Recording

Units = Mapping[str, str]


def load(
    path: str | os.PathLike[str],
    columns: Selection | Mapping[str, str] | None = None,
    *,
    held: Collection[str] = (),
    interpolated: Collection[str] = (),
) -> Recording:
    """Read a .csv, .parquet or .nc file, or `columns` of a vehicle's log; the run is named after it.

    The rest is for logs alone and handed to `load_log`. Raises InputError, naming the file and where it applies the row
    and column, whatever the file holds.
    """
    path = Path(path)
    if path.suffix.lower() in SUFFIXES or (path / "metadata.yaml").is_file():
        if columns is None:
            what = "is a log of many channels"
            raise InputError(str(path), what, f"say which to take by --columns; `jaxsub channels {path}` lists them")
        return load_log(path, columns, held=held, interpolated=interpolated)
    read, _ = _format(path)
    if not path.is_file():
        raise InputError(str(path), "is a folder" if path.is_dir() else "no such file", "give the path of a recording")
    if columns is not None:
        raise InputError(str(path), "is no log: its headers name its columns", "leave --columns out")
    return recorded(read(path), path.stem, str(path))


def save(recording: Recording, path: str | os.PathLike[str], units: Units | None = None) -> None:
    """Write a .csv, .parquet or .nc file, in SI but for the columns that `units` names a unit for.

    A save that fails leaves an older file as it was. Raises InputError for an unknown extension, column or unit, a
    column name that the format cannot hold, and a path that cannot be written.
    """
    path = Path(path)
    _, write = _format(path)
    recording.in_units(units or {})  # refuses a wrong unit before anything is written
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=".jaxsub-") as folder:
            write(Path(folder) / path.name, recording, units or {})
            os.replace(Path(folder) / path.name, path)
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror or error})", "check its folder") from error


def _format(path: Path) -> tuple[Callable[[Path], Table], Callable[[Path, Recording, Units], None]]:
    if found := _FORMATS.get(path.suffix.lower()):
        return found
    raise InputError(str(path), f"unknown extension {path.suffix!r}", f"use {', '.join(_FORMATS)}")


@contextmanager
def _reading(path: Path, form: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # no library promises what it raises on a damaged file
        raise InputError(str(path), f"cannot be read ({error})", f"check that it is whole and is {form}") from error


def _read_csv(path: Path) -> Table:
    # Not through pandas, which pads short rows and loses the row number of a bad cell.
    with _reading(path, "UTF-8 text"), path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.reader(file))
    while rows and not "".join(rows[-1]).strip():
        rows.pop()
    if not rows:
        raise InputError(str(path), "is empty", "write a header and a row for each sample")
    header, body = rows[0], rows[1:]
    for row, cells in enumerate(body, FIRST_ROW):
        if len(cells) != len(header):
            what = f"{len(cells)} cells under {len(header)} headers"
            raise InputError(f"{path}, row {row}", what, "give every row a cell for each header")
    return [(name, np.array([cells[i] for cells in body], object)) for i, name in enumerate(header)]


def _write_csv(path: Path, recording: Recording, units: Units) -> None:
    to_pandas(recording, units).to_csv(path, index=False)


def _read_parquet(path: Path) -> Table:
    with _reading(path, "Parquet"), parquet.ParquetFile(path) as file:
        table = file.read()
        columns = [column.to_numpy() for column in table.columns]
    return list(zip(table.column_names, columns, strict=True))


def _write_parquet(path: Path, recording: Recording, units: Units) -> None:
    to_pandas(recording, units).to_parquet(path, index=False)


def _read_netcdf(path: Path) -> Table:
    # h5netcdf complains on stderr as well if it fails on this attribute, so look at it first.
    with _reading(path, "NetCDF 4"), h5py.File(path) as file:
        file.attrs.get("_nc3_strict")
    with _reading(path, "NetCDF 4"), xarray.open_dataset(path, engine="h5netcdf", decode_times=False) as file:
        dataset = file.load()
    return variables(dataset, str(path))


def _write_netcdf(path: Path, recording: Recording, units: Units) -> None:
    to_xarray(recording, units).to_netcdf(path, engine="h5netcdf")


_FORMATS = {
    ".csv": (_read_csv, _write_csv),
    ".parquet": (_read_parquet, _write_parquet),
    ".nc": (_read_netcdf, _write_netcdf),
}
