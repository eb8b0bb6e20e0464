"""Recordings as MATLAB files (.mat), of version 4 to 7 and, as HDF5, 7.3, read by pymatreader."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from jaxsub.errors import InputError, optional
from jaxsub.recording.bounds import most, require_plausible
from jaxsub.recording.frames import Table
from jaxsub.recording.matlab_process import read_variables
from jaxsub.recording.reading import Contents, note, reading
from jaxsub.units import TIME

_HEADER = 128  # bytes
_COMPRESSED = 15  # MAT-File Format, table 1-1
_PIECE = 2**20
# samples, what they are made into, and both as they are handed over
_COPIES = 4
_ONE_NUMBER = "give one number a sample or leave the variable out"


def read_matlab(path: Path, source: str) -> Contents:
    """The arrays beside the one named `t`: at the top of the file, or fields of the one struct that has them.

    A field or variable `units`, itself a struct, may state the unit of each array: `units.r = 'deg/s'`.
    """
    with reading(source, "a MATLAB file"):
        found = read_structs(path, source)
        tables = dict(_tables(found))
        if len(tables) > 1:
            listed = ", ".join(name or "the file itself" for name in tables)
            raise InputError(
                source, f"has times {TIME!r} in {listed}", "save one of them: save('run.mat', '-struct', 's')"
            )
        place, values = next(iter(tables.items()), ("", found))
        notes = [note(source, "dialect", f"is read from the struct {place}")] if place else []
        return Contents(_columns(source, values), tuple(notes))


def read_structs(path: Path, source: str) -> dict[str, Any]:
    """The variables of a MATLAB file by name, structs as dictionaries."""
    optional("pymatreader", "files", source)
    with reading(source, "a MATLAB file"):
        _check(path, source)
        found = read_variables(path, _COPIES * most(path.stat().st_size))
    return {name: value for name, value in found.items() if not name.startswith("__")}


def _check(path: Path, source: str) -> None:
    """Raise InputError where the file expands to more than it plausibly holds."""
    import h5py

    size = path.stat().st_size
    if h5py.is_hdf5(path):
        sizes = []
        with h5py.File(path) as file:
            file.visititems(lambda _, item: sizes.append(item.nbytes) if isinstance(item, h5py.Dataset) else None)
        require_plausible(source, sum(sizes), size)
        return
    claimed = 0
    with path.open("rb") as file:
        head = file.read(_HEADER)
        if head[126:128] not in (b"IM", b"MI"):
            return  # version 4 is not compressed
        order = "<" if head[126:128] == b"IM" else ">"
        while len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            end = file.tell() + length
            if end > size:
                what = f"claims {length} bytes where {size - file.tell()} are left"
                raise InputError(source, what, "check that it is whole, or save it anew")
            if kind == _COMPRESSED:
                for piece in _inflated(file, length):
                    claimed += piece
                    require_plausible(source, claimed, size)
            file.seek(end)


def _inflated(file: Any, length: int) -> Iterator[int]:
    """The sizes of the pieces to which the next `length` bytes expand."""
    inflate = zlib.decompressobj()
    while length > 0 and not inflate.eof:
        data = inflate.unconsumed_tail or file.read(min(length, _PIECE))
        if not data:
            return
        length -= 0 if inflate.unconsumed_tail else len(data)
        yield len(inflate.decompress(data, _PIECE))
    while inflate.unconsumed_tail and not inflate.eof:
        yield len(inflate.decompress(inflate.unconsumed_tail, _PIECE))


def _tables(values: Mapping[str, Any], place: str = "", depth: int = 0) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Each struct that has a field of times, by its place; what is within such a one is not looked at."""
    if isinstance(values.get(TIME), np.ndarray):
        yield place, values
        return
    for name, value in values.items():
        if isinstance(value, Mapping) and depth < 8:
            yield from _tables(value, f"{place}.{name}" if place else name, depth + 1)


def _columns(source: str, values: Mapping[str, Any]) -> Table:
    units = values.get("units")
    stated = {k: v for k, v in units.items() if isinstance(v, str)} if isinstance(units, Mapping) else {}
    table: Table = []
    for name, value in values.items():
        if name.startswith("__") or (name == "units" and stated):
            continue
        header = f"{name}[{stated[name]}]" if name in stated else name
        array = np.asarray(value) if isinstance(value, np.ndarray | float | int) else np.array(None)
        if array.ndim == 1 and array.dtype.kind in "biuf":
            table.append((header, array))
            continue
        form = f"{array.ndim}-dimensional {array.dtype}" if isinstance(value, np.ndarray) else type(value).__name__
        table.append((header, InputError(f"{source}, variable {name!r}", f"holds {form} data", _ONE_NUMBER)))
    return table
