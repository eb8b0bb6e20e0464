"""Paths that are no files, and files of each binary kind: read as written, or refused at once in one line."""

import os
import socket
import zipfile
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas
import scipy.io
import xarray
from corpus import Case
from tables import reads, unusable

from jaxsub.recording import load

T = 0.5 * np.arange(4)
U = np.array([1.0, -2.0, 3.0, 4.5])
BOTH = {"t": T, "u": U}
NAN = float("nan")


def _case(name, file, write, *refused, check=None):
    """What `write` writes at a path `file`, loaded by that name or, after a `>`, by another."""
    target, _, asked = file.partition(">")

    def make(folder: Path) -> object:
        write(folder / target)
        return load(folder / (asked or target))

    return Case(name, make, refused, check or (None if refused else reads(**BOTH)))


def _socket(path):
    with socket.socket(socket.AF_UNIX) as one:
        here = Path.cwd()
        os.chdir(path.parent)  # a socket's path is short
        try:
            one.bind(path.name)
        finally:
            os.chdir(here)


def _no_write(path):
    del path


PATHS = [
    _case("a named pipe", "run.csv", os.mkfifo, "run.csv: is a named pipe"),
    _case("a folder", "run.nc", os.mkdir, "run.nc: is a folder"),
    _case("a socket", "run.mat", _socket, "run.mat: is a socket"),
    _case("a device", "run.parquet", lambda path: path.symlink_to("/dev/zero"), "run.parquet: is a device"),
    _case("an empty file", "run.xlsx", Path.touch, "run.xlsx: is empty"),
    _case("no file", "run.zip", _no_write, "run.zip: no such file"),
    _case("a link to nothing", "run.csv", lambda path: path.symlink_to(path.parent / "none"), "no such file"),
    _case("a link to itself", "run.csv", lambda path: path.symlink_to(path), "is no path"),
    _case("a file for a folder", "run.csv>run.csv/run.csv", lambda path: path.write_text("t\n"), "no such file"),
    _case("a name too long", f"run.csv>{'n' * 300}.csv", _no_write, "is no path"),
    Case("a NUL in a path", lambda folder: load(f"{folder}/run\0.csv"), ("run\\0.csv", "is no path")),
    _case("an unknown extension", "run.doc", lambda path: path.write_text("t\n"), "unknown extension '.doc'"),
]


def _mat(values, **settings):
    return lambda path: scipy.io.savemat(path, values, **settings)


def _hdf(values, head=b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"):
    def write(path):
        with h5py.File(path, "w", userblock_size=512) as file:
            for name, one in values.items():
                file[name] = one[None]
                file[name].attrs["MATLAB_class"] = np.bytes_("double")
        path.write_bytes(head + path.read_bytes()[len(head) :])

    return write


MATLAB = [
    _case("mat 5", "run.mat", _mat(BOTH)),
    _case("mat 5, columns and rows", "run.mat", _mat({"t": T[:, None], "u": U[None]}, do_compression=True)),
    _case("mat 4", "run.mat", _mat(BOTH, format="4")),
    _case("mat 7.3", "run.mat", _hdf(BOTH)),
    _case("mat 7.3, a struct", "run.mat", _hdf({"log/t": T, "log/u": U}), check=reads(said="the struct log", **BOTH)),
    _case("mat, a struct", "run.mat", _mat({"k": 1.0, "s": BOTH}), check=reads(said="the struct s", **BOTH)),
    _case("mat, nested", "run.mat", _mat({"s": {"imu": BOTH}}), check=reads(said="the struct s.imu", **BOTH)),
    _case(
        "mat, units", "run.mat", _mat({**BOTH, "units": {"t": "ms", "u": "km/h"}}), check=reads(t=T / 1e3, u=U / 3.6)
    ),
    _case("mat, integers", "run.mat", _mat({"t": np.arange(4, dtype="i4"), "u": U}), check=reads(t=np.arange(4), u=U)),
    _case("mat, a matrix", "run.mat", _mat({**BOTH, "M": np.eye(4)}), check=unusable("M", "2-dimensional", **BOTH)),
    _case("mat, text", "run.mat", _mat({**BOTH, "name": "boat"}), check=unusable("name", "holds str data", **BOTH)),
    _case("mat, two structs", "run.mat", _mat({"a": BOTH, "b": BOTH}), "times 't' in a, b", "save one of them"),
    _case("mat, no time", "run.mat", _mat({"time": T, "u": U}), "no time column 't'", "rename 'time'"),
    _case("mat, unequal lengths", "run.mat", _mat({**BOTH, "x": T[:3]}), check=unusable("x", "(3,)", **BOTH)),
    _case("mat that expands", "run.mat", _mat({"t": np.zeros(34_000_000)}, do_compression=True), "claims", "its size"),
    _case("mat cut off", "run.mat", lambda p: (_mat(BOTH)(p), p.write_bytes(p.read_bytes()[:-60])), "claims"),
    _case("mat of nonsense", "run.mat", lambda p: p.write_bytes(b"nonsense" * 40), "cannot be read"),
]


def _netcdf(form, **attributes):
    def write(path):
        kind = np.int16 if any(key in attributes for key in ("scale_factor", "_FillValue")) else np.float64
        variables = {"u": ("t", np.array([10, -20, 30, 45]).astype(kind), attributes)}
        made = xarray.Dataset(variables, {"t": ("t", T / 86400.0, {"units": "days since 2020-01-01"})})
        if form == "NETCDF3_CLASSIC":
            made.to_netcdf(path, engine="scipy", format=form)
        else:
            made.to_netcdf(path, engine="h5netcdf")

    return write


def _huge(path):
    with h5py.File(path, "w") as file:
        for name in "tu":
            file.create_dataset(name, (2**32,), "f8", chunks=(1024,))


def _masked(words, *values):
    return reads(said=words, t=T, u=values)


I16 = np.int16
NETCDF = [
    _case("NetCDF 4", "run.nc", _netcdf("", units="dm/s"), check=reads(t=T, u=[1, -2, 3, 4.5])),
    _case("NetCDF 3", "run.nc", _netcdf("NETCDF3_CLASSIC", units="dm/s"), check=reads(t=T, u=[1, -2, 3, 4.5])),
    _case(
        "NetCDF, packed",
        "run.nc",
        _netcdf("", scale_factor=0.1, add_offset=1.0),
        check=reads(t=T, u=[2.0, -1.0, 4.0, 5.5]),
    ),
    _case(
        "NetCDF, _FillValue",
        "run.nc",
        _netcdf("", _FillValue=I16(-20)),
        check=_masked("column 'u': 1 row (25 %) masked as _FillValue -20", 10, NAN, 30, 45),
    ),
    _case(
        "NetCDF, missing_value",
        "run.nc",
        _netcdf("", missing_value=30.0),
        check=_masked("masked as missing_value 30", 10, -20, NAN, 45),
    ),
    _case(
        "NetCDF, valid_min",
        "run.nc",
        _netcdf("", valid_min=0.0),
        check=_masked("masked as below valid_min 0", 10, NAN, 30, 45),
    ),
    _case(
        "NetCDF, valid_range of packed",
        "run.nc",
        _netcdf("", valid_range=np.array([-20, 30], I16), scale_factor=0.5),
        check=_masked("masked as above valid_range 30", 5, -10, 15, NAN),
    ),
    _case(
        "NetCDF 3, valid_max",
        "run.nc",
        _netcdf("NETCDF3_CLASSIC", valid_max=40.0),
        check=_masked("masked as above valid_max 40", 10, -20, 30, NAN),
    ),
    _case(
        "NetCDF, other dimensions",
        "run.nc",
        lambda p: xarray.Dataset({"u": ("t", U), "sea": (("t", "z"), np.zeros((4, 3)))}, {"t": T}).to_netcdf(
            p, engine="h5netcdf"
        ),
        check=unusable("sea", "runs along 't' and 'z'", **BOTH),
    ),
    _case("HDF5 that claims 2**32 rows", "run.nc", _huge, "claims 64 GiB of samples", "check that it is whole"),
    _case("NetCDF 3 cut off", "run.nc", lambda p: p.write_bytes(b"CDF\x01" + b"\0" * 12), "cannot be read"),
    _case("NetCDF of nonsense", "run.nc", lambda p: p.write_bytes(b"nonsense" * 40), "cannot be read"),
]


def _excel(*sheets, **settings):
    def write(path):
        with pandas.ExcelWriter(path) as book:
            for index, sheet in enumerate(sheets):
                sheet.to_excel(book, sheet_name=f"S{index + 1}", **({"index": False} | settings))

    return write


def _far(path):
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet["A1"], sheet["XFD1048576"] = "t", 1
    book.save(path)


FRAME = pandas.DataFrame(BOTH)
UNITS = pandas.DataFrame({"t (ms)": 1e3 * T, "u[km/h]": 3.6 * U})
DATED = pandas.DataFrame({"t": pandas.Timestamp("2024-06-01") + pandas.to_timedelta(T, unit="s"), "u": U})
WORKBOOK = [
    _case("workbook", "run.xlsx", _excel(FRAME)),
    _case("workbook, units", "run.xlsx", _excel(UNITS), check=reads(said="units in parentheses", **BOTH)),
    _case("workbook, index", "run.xlsx", _excel(FRAME, index=True), check=reads(said="column 1 left out", **BOTH)),
    _case("workbook, dates", "run.xlsx", _excel(DATED), check=reads(said="ISO 8601 instants", **BOTH)),
    _case("workbook, blank rows above", "run.xlsx", _excel(FRAME, startrow=3)),
    _case("workbook, other sheets", "run.xlsx", _excel(FRAME, DATED[["u"]]), check=reads(said="sheet 'S1'", **BOTH)),
    _case("workbook, two runs", "run.xlsx", _excel(FRAME, FRAME), "2 sheets with a header 't' of S1, S2"),
    _case(
        "workbook, text",
        "run.xlsx",
        _excel(FRAME.assign(note=list("abcd"))),
        check=unusable("note", "row 2, column 'note': 'a' is not a number", **BOTH),
    ),
    _case("workbook, one cell far away", "run.xlsx", _far, "claims 384 GiB of samples"),
    _case("workbook of nonsense", "run.xlsx", lambda p: p.write_bytes(b"PK nonsense" * 40), "cannot be read"),
]


def _zip(**members):
    def write(path):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name.replace("__", "/").replace("_", "."), content)

    return write


CSV = "t,u\n" + "".join(f"{t},{u}\n" for t, u in zip(T, U, strict=True))
ARCHIVE = [
    _case("zip of one", "runs.zip", _zip(dive_csv=CSV, readme_md="x")),
    _case("zip of one in a folder", "runs.zip", _zip(sea__dive_csv=CSV)),
    _case("zip of two, one named", "runs.zip>runs.zip!b.csv", _zip(a_csv="t\n0\n1\n", b_csv=CSV)),
    _case("zip of two", "runs.zip", _zip(a_csv=CSV, b_csv=CSV), "holds 2 recordings: a.csv, b.csv", "runs.zip!a.csv'"),
    _case("zip, misspelt", "runs.zip>runs.zip!c.csv", _zip(a_csv=CSV), "no recording 'c.csv'", "did you mean 'a.csv'"),
    _case("zip in a zip", "runs.zip", _zip(a_zip=CSV), "holds no recording"),
    _case("zip, bad row", "runs.zip", _zip(a_csv="t,u\n0,1\n0,2\n"), "runs.zip!a.csv, row 3: time 0.0 s does not come"),
    _case("zip, empty member", "runs.zip", _zip(a_csv=""), "runs.zip!a.csv: is empty"),
    _case("zip that expands", "runs.zip", _zip(a_csv="0" * 270_000_000), "claims 257 MiB of samples", "its size"),
    _case("zip of nonsense", "runs.zip", lambda p: p.write_bytes(b"PK nonsense" * 40), "cannot be read"),
]


def _parquet(frame):
    return lambda path: frame.to_parquet(path)


def _many_rows(path):
    from pyarrow import parquet, table

    rows = np.zeros(60_000_000, np.int8)
    parquet.write_table(table({"t": rows, "u": rows}), path, compression="zstd")


PARQUET = [
    _case("Parquet", "run.parquet", _parquet(FRAME)),
    _case("Parquet, dates", "run.parquet", _parquet(DATED)),
    _case(
        "Parquet, text",
        "run.parquet",
        _parquet(FRAME.assign(note=list("abcd"))),
        check=unusable("note", "'a' is not a number", **BOTH),
    ),
    _case(
        "Parquet, lists",
        "run.parquet",
        _parquet(FRAME.assign(x=[[1.0, 2.0]] * 4)),
        check=unusable("x", "column 'x'", **BOTH),
    ),
    _case("Parquet that claims more than it can hold", "run.parquet", _many_rows, "claims", "times its size"),
    _case("Parquet cut off", "run.parquet", lambda p: p.write_bytes(b"PAR1" * 30), "cannot be read"),
]
CASES = [*PATHS, *MATLAB, *NETCDF, *WORKBOOK, *ARCHIVE, *PARQUET]
