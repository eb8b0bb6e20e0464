"""Recordings as files whose headers are `name` (SI) or `name[unit]`: CSV and its like, Parquet, NetCDF and more."""

import os
from collections.abc import Callable, Collection, Mapping
from pathlib import Path, PurePosixPath
from typing import TypeVar

import numpy as np

from jaxsub.errors import InputError, OutputError
from jaxsub.recording.archive import MARK, extracted, split_member
from jaxsub.recording.frames import recorded, recorded_in_order, to_pandas, to_xarray
from jaxsub.recording.layout import with_brackets
from jaxsub.recording.logs import SUFFIXES, Channel, Listing, Selection, load_log
from jaxsub.recording.logs import contents as contents_of_log
from jaxsub.recording.matlab import read_matlab
from jaxsub.recording.netcdf import read_netcdf
from jaxsub.recording.parquet import read_parquet
from jaxsub.recording.reading import Contents, require_file
from jaxsub.recording.recording import Recording
from jaxsub.recording.text import read_text
from jaxsub.recording.workbook import read_workbook
from jaxsub.storage import written_whole
from jaxsub.units import split_header

T = TypeVar("T")
Units = Mapping[str, str]
Reader = Callable[[Path, str], Contents]
Writer = Callable[[Path, Recording, Units], None]


def load(
    path: str | os.PathLike[str],
    columns: Selection | Mapping[str, str] | None = None,
    *,
    held: Collection[str] = (),
    interpolated: Collection[str] = (),
) -> Recording:
    """Read the file `path` with a recording, or `columns` of a vehicle's log; the run is named after it.

    The file is .csv, .tsv or .txt, .parquet, .nc, .mat, .xlsx, or a .zip of one of these, `runs.zip!dive.csv` where it
    holds several. How it was read is in the run's findings, where that is not plain. `columns`, `held` and
    `interpolated` are for logs alone and handed to `load_log`. Raises InputError, naming the file and where it applies
    the row and column, whatever the file holds.
    """
    path = Path(path)
    if is_log(path):
        if columns is None:
            what = "is a log of many channels"
            raise InputError(str(path), what, f"say which to take by --columns; `jaxsub channels {path}` lists them")
        return load_log(path, columns, held=held, interpolated=interpolated)
    if columns is not None:
        raise InputError(str(path), "is no log: its headers name its columns", "leave --columns out")
    found, name, source = read(path)
    return recorded(found.table, name, source, found.first_row, found.findings)


def load_in_order(path: str | os.PathLike[str]) -> Recording:
    """The recording in the file `path`, as `load` reads it, without the fewest rows that leave its times in order.

    A warning in its findings counts them. Raises InputError as `load` does, and where less than half would be left.
    """
    found, name, source = read(Path(path))
    return recorded_in_order(found.table, name, source, found.first_row, found.findings)


def is_log(path: Path) -> bool:
    """Whether a path leads to a vehicle's log, by its suffix, and not to the file of a recording."""
    return path.suffix.lower() in SUFFIXES or _is_bag(path)


def contents(path: str | os.PathLike[str]) -> Listing:
    """What the log or recording at `path` holds: name, unit where it states one, and number of samples.

    A column that holds no numbers has no samples. The findings say how the file was read, where that is not plain, and
    what of an incomplete log is lost. Raises InputError for a file that cannot be read.
    """
    path = Path(path)
    if is_log(path):
        return contents_of_log(path)
    listed, found = [], read(path)[0]
    for header, values in found.table:
        name, unit = split_header(header)
        listed.append(Channel(name, unit or "", _measured(values)))
    return Listing(listed, found.findings)


def _measured(values: np.ndarray | InputError) -> int:
    """How many samples of a column are numbers or times."""
    if not isinstance(values, np.ndarray) or values.ndim != 1 or values.dtype.kind not in "biufmM":
        return 0
    return int((~np.isnan(values)).sum())


def read(path: Path) -> tuple[Contents, str, str]:
    """What the file of a recording holds, the run's name and the file as errors name it."""
    file, member = split_member(path)
    if file.suffix.lower() == ARCHIVE:
        with extracted(file, member, _READERS) as (target, name):
            source = f"{file}{MARK}{name}"
            found = _of_suffix(_READERS, target, source)(target, source)
            return found, PurePosixPath(name).stem if member else file.stem, source
    if os.path.exists(path):
        require_file(path)  # first, so that a folder is called one and not a file without an extension
    reader = _of_suffix(_READERS, path, str(path))
    require_file(path)
    return reader(path, str(path)), path.stem, str(path)


def save(recording: Recording, path: str | os.PathLike[str], units: Units | None = None) -> None:
    """Write `recording` to `path`, a .csv, .parquet or .nc file.

    Columns are in SI but for those that `units` names a unit for. A save that fails leaves an older file as it was.
    Raises InputError for an unknown extension, column or unit, a column name that the format cannot hold, and a path
    that cannot be written.
    """
    path = Path(path)
    write = _of_suffix(_WRITERS, path, str(path))
    recording.in_units(units or {})  # refuses a wrong unit before anything is written
    try:
        with written_whole(path) as beside:
            write(beside, recording, units or {})
    except OSError as error:
        raise OutputError(str(path), f"cannot be written ({error.strerror or error})", "check its folder") from error


def _of_suffix(known: Mapping[str, T], path: Path, source: str) -> T:
    if found := known.get(path.suffix.lower()):
        return found
    suffixes = ", ".join([*known, ARCHIVE] if known is _READERS else known)
    raise InputError(source.replace("\0", "\\0"), f"unknown extension {path.suffix!r}", f"use {suffixes}")


def _is_bag(path: Path) -> bool:
    try:
        return (path / "metadata.yaml").is_file()
    except (OSError, ValueError):  # a name that is too long or has a NUL
        return False


def _write_csv(path: Path, recording: Recording, units: Units) -> None:
    for name in recording.columns:
        if with_brackets(name) != name:
            what = "is a name that a text file would read as one with a unit"
            raise InputError(f"column {name!r}", what, "rename it or write a .parquet file")
    to_pandas(recording, units).to_csv(path, index=False)


def _write_parquet(path: Path, recording: Recording, units: Units) -> None:
    to_pandas(recording, units).to_parquet(path, index=False)


def _write_netcdf(path: Path, recording: Recording, units: Units) -> None:
    # through memory: HDF5 prints its own errors where a disk is full
    path.write_bytes(bytes(to_xarray(recording, units).to_netcdf(engine="h5netcdf")))


ARCHIVE = ".zip"
_READERS: dict[str, Reader] = {
    ".csv": read_text,
    ".tsv": read_text,
    ".txt": read_text,
    ".parquet": read_parquet,
    ".nc": read_netcdf,
    ".mat": read_matlab,
    ".xlsx": read_workbook,
}
_WRITERS: dict[str, Writer] = {".csv": _write_csv, ".parquet": _write_parquet, ".nc": _write_netcdf}
