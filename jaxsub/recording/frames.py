"""Recordings from and to pandas and xarray, under the rules that hold for files."""

import re
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from jaxsub.errors import InputError, nearest
from jaxsub.findings import Finding
from jaxsub.recording.order import disorder, in_order
from jaxsub.recording.recording import FIRST_ROW, Recording, check_column
from jaxsub.units import TIME, column_to_si, split_header

# imported where they are used, so that commands that need neither start sooner
if TYPE_CHECKING:
    import pandas
    import xarray

# As read: headers, which may still occur twice, and numbers, text or objects; an error where a reader knows that a
# column cannot be used.
Table = list[tuple[str, np.ndarray | InputError]]

_ONE_NUMBER = "give one number a sample or leave the column out"


def from_pandas(frame: "pandas.DataFrame", name: str = "run") -> Recording:
    """The run in the columns of `frame`, headed `name` (SI) or `name[unit]`; a missing value is a missing sample.

    The time is the column `t`; else the index, if that is named `t` or holds times or spans. Instants count in s from
    the first. Raises InputError for whatever a file would be refused for, naming `name`.
    """
    import pandas

    table: Table = [(str(header), _of_series(column)) for header, column in frame.items()]
    if not any(_is_time(header) for header, _ in table):
        index = frame.index
        if _is_time(str(index.name)):
            table.append((str(index.name), _of_series(index.to_series())))
        elif isinstance(index, pandas.DatetimeIndex | pandas.TimedeltaIndex):
            table.append((TIME, _of_series(index.to_series())))
    return recorded(table, name, name)


def to_pandas(recording: Recording, units: Mapping[str, str] | None = None) -> "pandas.DataFrame":
    """`recording` as a frame that `from_pandas` reads, in SI but for the columns that `units` names a unit for.

    Raises InputError for an absent column or an unknown unit.
    """
    import pandas

    return pandas.DataFrame(recording.in_units(units or {}))


def from_xarray(dataset: "xarray.Dataset", name: str = "run") -> Recording:
    """The run in the variables of `dataset`, one number a sample each, `t` its times.

    A variable's unit is its attribute `units`, or is in its name as in a file's header; without either it is SI.
    Instants count in s from the first. Raises InputError for whatever a file would be refused for, naming `name`.
    """
    return recorded(variables(dataset, name), name, name)


def to_xarray(recording: Recording, units: Mapping[str, str] | None = None) -> "xarray.Dataset":
    """`recording` as a dataset along `t` that `from_xarray` reads.

    It is in SI but for the columns that `units` names a unit for. Raises InputError for an absent column, an unknown
    unit or a name that NetCDF could not hold.
    """
    import xarray

    dataset = xarray.Dataset()
    for header, values in recording.in_units(units or {}).items():
        name, _, unit = header.rstrip("]").partition("[")
        if not re.fullmatch(r"\w[^/\x00-\x1f\x7f]*", name):
            raise InputError(f"column {name!r}", "is a name that NetCDF cannot hold", "rename it or write a .csv file")
        dataset[name] = xarray.Variable(TIME, values, {"units": unit} if unit else {})
    return dataset


def recorded_in_order(
    table: Table, name: str, source: str, first_row: int = FIRST_ROW, findings: tuple[Finding, ...] = ()
) -> Recording:
    """As `recorded`, without the fewest rows that leave times in order; a finding says how many and why.

    Raises InputError as `recorded` does, and where less than half of the rows would be left.
    """
    header = next((header for header, _ in table if split_header(header)[0] == TIME), None)
    if header is None:
        return recorded(table, name, source, first_row, findings)
    times, _ = _in_si(source, [header], dict(table), first_row)
    kept = in_order(times)
    if len(kept) == len(times):
        return recorded(table, name, source, first_row, findings)
    found = disorder(source, times, kept, first_row)
    rows: Table = [(header, values[kept] if isinstance(values, np.ndarray) else values) for header, values in table]
    return recorded(rows, name, source, first_row, (*findings, found))


def recorded(
    table: Table, name: str, source: str, first_row: int = FIRST_ROW, findings: tuple[Finding, ...] = ()
) -> Recording:
    """The run `name` from headed columns as read, numbers or text, in their own units.

    `first_row` is the row of the first sample in `source`. A column that holds no numbers, whose unit is none or whose
    name occurs twice goes to `Recording.unusable`, since most logs have some that no vehicle needs. Raises InputError,
    naming `source`, for times that are absent, no numbers or not in order.
    """
    headers: dict[str, list[str]] = {}
    for header, _ in table:
        headers.setdefault(split_header(header)[0], []).append(header)
    if TIME not in headers:
        similar = next((name for name in headers if "time" in name.lower()), nearest(TIME, headers))
        remedy = f"rename {similar!r} to {TIME!r}" if similar else f"add a column headed {TIME}[s]"
        raise InputError(source, f"has no time column {TIME!r}", remedy)
    values = dict(table)
    times, _ = _in_si(source, headers[TIME], values, first_row)
    columns, units, unusable = {}, {}, {}
    for column, named in headers.items():
        if column == TIME:
            continue
        try:
            samples, unit = _in_si(source, named, values, first_row)
            check_column(source, first_row, times, column, samples)
        except InputError as error:
            unusable[column] = error
            continue
        columns[column] = samples
        units |= {column: unit} if unit else {}
    return Recording(name, times, columns, source, first_row, units, unusable, findings)


def _in_si(
    source: str, named: list[str], values: Mapping[str, np.ndarray | InputError], first_row: int
) -> tuple[np.ndarray, str]:
    """The samples under the headers `named`, in SI, and their unit, empty where the header states none."""
    if len(named) > 1:
        raise InputError(source, f"headers {' and '.join(map(repr, named))} name one column", "rename or delete one")
    name, unit = split_header(named[0])
    samples = numeric(source, named[0], values[named[0]], first_row)
    return (samples, "") if unit is None else column_to_si(f"{source}, header {named[0]!r}", name, samples, unit)


def variables(dataset: "xarray.Dataset", source: str) -> Table:
    """The variables of a dataset with their units in their headers."""
    along = next((variable.dims for name, variable in dataset.variables.items() if _is_time(str(name))), None)
    table: Table = []
    for name, variable in dataset.variables.items():
        bare = "units" in variable.attrs and "[" not in str(name)
        unit = re.sub(r"[\[\]]", "", str(variable.attrs.get("units")))
        header = f"{name}[{unit}]" if bare else str(name)
        if along in (None, variable.dims):
            table.append((header, variable.to_numpy()))
        else:
            what = f"runs along {_listed(variable.dims)}, its times along {_listed(along)}"
            table.append((header, InputError(f"{source}, variable {name!r}", what, _ONE_NUMBER)))
    return table


def numeric(source: str, header: str, values: np.ndarray | InputError, first_row: int = FIRST_ROW) -> np.ndarray:
    """One number a sample, float64; a time that holds instants or spans in s. Raises InputError for anything else."""
    if isinstance(values, InputError):
        raise values
    if values.ndim == 1 and values.dtype.kind in "mM" and _is_time(header):
        return (values - values[:1] if values.dtype.kind == "M" else values) / np.timedelta64(1, "s")
    if values.ndim == 1 and values.dtype.kind in "OUST":
        return _parsed(source, header, values, first_row)
    if values.dtype.kind not in "biuf" or values.ndim != 1:
        what = f"holds {values.ndim}-dimensional {values.dtype} data"
        raise InputError(f"{source}, column {header!r}", what, _ONE_NUMBER)
    return values.astype(np.float64)


def _parsed(source: str, header: str, cells: np.ndarray, first_row: int) -> np.ndarray:
    """The numbers that cells of text or objects hold, NaN for blank ones."""
    numbers = np.empty(len(cells))
    for index, cell in enumerate(cells):
        try:
            text = cell.decode() if isinstance(cell, bytes) else cell
            # float() would read 1_000 as a thousand
            if not isinstance(text, str):
                numbers[index] = np.nan if _is_missing(text) else float(text)
            elif text.isascii() and "_" not in text:
                numbers[index] = float(text.strip() or "nan")
            else:
                raise ValueError
        except (TypeError, ValueError, OverflowError) as error:
            where = f"{source}, row {index + first_row}, column {header!r}"
            shown = repr(str(cell) if isinstance(cell, str) else cell)  # a NumPy string shows its type
            raise InputError(where, f"{shown:.60} is not a number", "write a number or leave the cell blank") from error
    return numbers


def _is_missing(cell: Any) -> bool:
    import pandas

    return cell is None or cell is pandas.NA


def _listed(dimensions: tuple[Hashable, ...]) -> str:
    return " and ".join(map(repr, dimensions)) or "nothing"


def _of_series(series: Any) -> np.ndarray:
    import pandas

    if pandas.api.types.is_extension_array_dtype(series.dtype) and pandas.api.types.is_numeric_dtype(series.dtype):
        return series.to_numpy(np.float64, na_value=np.nan)
    if isinstance(series.dtype, pandas.DatetimeTZDtype):
        series = series.dt.tz_convert(None)
    return series.to_numpy()


def _is_time(header: str) -> bool:
    return header.partition("[")[0].strip() == TIME
