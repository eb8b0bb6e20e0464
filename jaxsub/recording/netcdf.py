"""Recordings as NetCDF files, 4 (HDF5) and classic, under the CF conventions for packed and missing samples."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from jaxsub.findings import Finding
from jaxsub.recording.bounds import require_plausible
from jaxsub.recording.frames import variables
from jaxsub.recording.reading import Contents, note, reading
from jaxsub.units import TIME, split_header

if TYPE_CHECKING:
    import xarray

_CLASSIC = b"CDF"


def read_netcdf(path: Path, source: str) -> Contents:
    """The variables along the dimension of `t`, with a note of each that has masked samples."""
    import xarray

    with reading(source, "NetCDF"):
        engine = _checked(path, source)
        # xarray's own masking would not count, and does not know valid_min
        settings: dict[str, Any] = {"mmap": False} if engine == "scipy" else {}
        with xarray.open_dataset(path, decode_cf=False, engine=engine, **settings) as file:
            along = next((v.dims for name, v in file.variables.items() if _is_time(name)), None)
            kept, findings = {}, []
            for name, variable in file.variables.items():
                if along is None:
                    kept[name] = xarray.Variable((), np.nan)  # rejected by its names alone
                elif variable.dims != along or len(along) != 1:
                    kept[name] = variable  # not loaded
                else:
                    values, notes = _decoded(source, str(name), variable)
                    kept[name] = xarray.Variable(along, values, _unit(variable.attrs))
                    findings += notes
            table = variables(xarray.Dataset(kept), source)
    return Contents(table, tuple(findings))


def _checked(path: Path, source: str) -> Literal["scipy", "h5netcdf"]:
    """The name of the engine that reads the file, once what its headers claim has been found to be plausible."""
    import h5py

    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(3) == _CLASSIC:
            return "scipy"  # uncompressed: what is not in the file cannot be read
    with h5py.File(path) as file:
        # h5netcdf complains on stderr as well if it fails on this attribute, so look at it first
        file.attrs.get("_nc3_strict")
        columns = [item for item in file.values() if isinstance(item, h5py.Dataset) and item.ndim == 1]
        require_plausible(source, sum(len(item) * max(item.dtype.itemsize, 8) for item in columns), size)
    return "h5netcdf"


def _decoded(source: str, name: str, variable: "xarray.Variable") -> tuple[np.ndarray, list[Finding]]:
    """The samples unpacked, NaN where the file's attributes say that there is none, and a note of each such reason."""
    raw = variable.to_numpy()
    if raw.dtype.kind not in "iuf":
        return raw, []
    attributes = variable.attrs
    if str(attributes.get("_Unsigned", "")).lower() == "true" and raw.dtype.kind == "i":
        raw = raw.view(f"u{raw.dtype.itemsize}")
    values = raw.astype(np.float64)
    scale, offset = (_number(attributes, key, bare) for key, bare in (("scale_factor", 1.0), ("add_offset", 0.0)))
    unpacked = values if (scale, offset) == (1.0, 0.0) else values * scale + offset
    missing = np.zeros(len(raw), bool)
    notes = []
    for reason, bad in _reasons(attributes, raw, unpacked):
        new = bad & ~missing & ~np.isnan(values)
        missing |= bad
        if count := int(new.sum()):
            what = f"{count} row{'s' if count > 1 else ''} ({100.0 * count / len(raw):.3g} %) masked as {reason}"
            notes.append(note(source, "masked", what, name, count))
    return np.where(missing, np.nan, unpacked), notes


def _reasons(attributes: dict[Any, Any], raw: np.ndarray, unpacked: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Each reason for which samples are missing, and which these are."""
    for key in ("_FillValue", "missing_value"):
        for value in np.ravel(attributes.get(key, ())):
            stored = np.asarray(value).astype(raw.dtype) if np.asarray(value).dtype.kind in "iufb" else None
            if stored is not None:
                yield f"{key} {value:g}", raw == stored
    low, high = (np.ravel(attributes.get(key, ())) for key in ("valid_min", "valid_max"))
    both = np.ravel(attributes.get("valid_range", ()))
    for key, bound, above in (("valid_min", low, False), ("valid_max", high, True), *_pair(both)):
        if bound.size != 1 or bound.dtype.kind not in "iuf":
            continue
        # of packed data the bound is packed too, unless its type is that of unpacked data
        of = unpacked if bound.dtype.kind == "f" and raw.dtype.kind in "iu" else raw
        value = float(bound[0])
        yield f"{'above' if above else 'below'} {key} {value:g}", (of > value) if above else (of < value)


def _pair(both: np.ndarray) -> list[tuple[str, np.ndarray, bool]]:
    return [("valid_range", both[:1], False), ("valid_range", both[1:], True)] if both.size == 2 else []


def _number(attributes: dict[Any, Any], key: str, default: float) -> float:
    return float(np.ravel(attributes.get(key, default))[0])


def _unit(attributes: dict[Any, Any]) -> dict[str, Any]:
    return {"units": attributes["units"]} if "units" in attributes else {}


def _is_time(name: Any) -> bool:
    return split_header(str(name))[0] == TIME
