"""Recordings from and to pandas and xarray, under the rules that hold for files."""

import re
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np
import pandas
import xarray

from jaxsub.errors import InputError, nearest
from jaxsub.recording.recording import Recording
from jaxsub.units import TIME, si_columns

Table = list[tuple[str, np.ndarray]]  # as read, when a header may still occur twice


def from_pandas(frame: pandas.DataFrame, name: str = "run") -> Recording:
    """The run in the columns of `frame`, headed `name` (SI) or `name[unit]`; a missing value is a missing sample.

    The time is the column `t`; else the index, if that is named `t` or holds times or spans. Instants count in s from
    the first. Raises InputError for whatever a file would be refused for, naming `name`.
    """
    table = [(str(header), _of_series(name, header, column)) for header, column in frame.items()]
    if not any(_is_time(header) for header, _ in table):
        index = frame.index
        if _is_time(str(index.name)):
            table.append((str(index.name), _of_series(name, str(index.name), index.to_series())))
        elif isinstance(index, pandas.DatetimeIndex | pandas.TimedeltaIndex):
            table.append((TIME, _of_series(name, TIME, index.to_series())))
    return recorded(table, name, name)


def to_pandas(recording: Recording, units: Mapping[str, str] | None = None) -> pandas.DataFrame:
    """A frame as `from_pandas` reads it, in SI but for the columns that `units` names a unit for.

    Raises InputError for an absent column or an unknown unit.
    """
    return pandas.DataFrame(recording.in_units(units or {}))


def from_xarray(dataset: xarray.Dataset, name: str = "run") -> Recording:
    """The run in the variables of `dataset`, one number a sample each, `t` its times.

    A variable's unit is its attribute `units`, or stands in its name as in a file's header; without either it is SI.
    Instants count in s from the first. Raises InputError for whatever a file would be refused for, naming `name`.
    """
    return recorded(variables(dataset, name), name, name)


def to_xarray(recording: Recording, units: Mapping[str, str] | None = None) -> xarray.Dataset:
    """A dataset along `t` as `from_xarray` reads it, in SI but for the columns that `units` names a unit for.

    Raises InputError for an absent column, an unknown unit or a name that NetCDF could not hold.
    """
    dataset = xarray.Dataset()
    for header, values in recording.in_units(units or {}).items():
        name, _, unit = header.rstrip("]").partition("[")
        if not re.fullmatch(r"\w[^/\x00-\x1f\x7f]*", name):
            raise InputError(f"column {name!r}", "is a name that NetCDF cannot hold", "rename it or write a .csv file")
        dataset[name] = xarray.Variable(TIME, values, {"units": unit} if unit else {})
    return dataset


def recorded(table: Table, name: str, source: str) -> Recording:
    """The run `name` from headed columns in their own units. Raises InputError, naming `source`, for a bad one."""
    columns = si_columns(source, table)
    if TIME not in columns:
        similar = next((name for name in columns if "time" in name.lower()), nearest(TIME, columns))
        remedy = f"rename {similar!r} to {TIME!r}" if similar else f"add a column headed {TIME}[s]"
        raise InputError(source, f"has no time column {TIME!r}", remedy)
    return Recording(name, columns.pop(TIME), columns, source)


def variables(dataset: xarray.Dataset, source: str) -> Table:
    """The variables of a dataset with their units in their headers."""
    table = []
    for name, variable in dataset.variables.items():
        bare = "units" in variable.attrs and "[" not in str(name)
        header = f"{name}[{variable.attrs['units']}]" if bare else str(name)
        table.append((header, numeric(source, str(name), variable.to_numpy())))
    return table


def numeric(source: str, header: str, values: np.ndarray) -> np.ndarray:
    """One number a sample, float64; a time that holds instants or spans in s. Raises InputError for anything else."""
    if values.ndim == 1 and values.dtype.kind in "mM" and _is_time(header):
        return (values - values[:1] if values.dtype.kind == "M" else values) / np.timedelta64(1, "s")
    if values.dtype.kind not in "biuf" or values.ndim != 1:
        what = f"holds {values.ndim}-dimensional {values.dtype} data"
        raise InputError(f"{source}, column {header!r}", what, "give one number a sample or leave the column out")
    return values.astype(np.float64)


def _of_series(source: str, header: Hashable, series: Any) -> np.ndarray:
    if pandas.api.types.is_extension_array_dtype(series.dtype) and pandas.api.types.is_numeric_dtype(series.dtype):
        return series.to_numpy(np.float64, na_value=np.nan)
    if isinstance(series.dtype, pandas.DatetimeTZDtype):
        series = series.dt.tz_convert(None)
    return numeric(source, str(header), series.to_numpy())


def _is_time(header: str) -> bool:
    return header.partition("[")[0].strip() == TIME
