"""Reading the pieces of a vehicle file, with errors that say where, what and what to do."""

import dataclasses
import math
import re
from typing import Any

from ..errors import InputError, suggestion
from ..parameters import Parameter
from ..units import UnknownUnit, is_si, same_dimension, si_unit

# the largest size of a number, and its inverse the smallest: what a model makes of several such is a float still
_LARGEST = 1e60
_NUMBER_KEYS = ("value", "fixed", "free", "bounds", "prior_std", "prior_mean", "varies", "spread", "unit")


class Table:
    """One table of a vehicle file, which knows its place for error messages."""

    def __init__(self, data: Any, where: str, section: str):
        if not isinstance(data, dict):
            raise InputError(f"{where}: {section}", "is not a table", f"write [{section}]")
        self.data, self.where, self.section = data, where, section

    def items(self) -> list[tuple[str, Any]]:
        """Key and value pairs."""
        return list(self.data.items())

    def place(self, key: str) -> str:
        """File, section and key."""
        return f"{self.where}: {self.section + '.' if self.section else ''}{key}"

    def only(self, known: tuple[str, ...]) -> None:
        """Refuse keys that are not `known`."""
        for key in self.data:
            if key not in known:
                raise unknown_key(self.place(key), known, key)

    def required(self, key: str) -> Any:
        """The value of `key`, which must be there."""
        if key not in self.data:
            raise InputError(self.place(key), "is missing", f"add {key} = …")
        return self.data[key]

    def choice(self, key: str, known: tuple[str, ...]) -> str:
        """The value of `key`, one of `known`."""
        value = self.required(key)
        if value not in known:
            hint = suggestion(str(value), known, f"choose one of {', '.join(known)}")
            raise InputError(self.place(key), f"{value!r:.60} is not known", hint)
        return value

    def word(self, key: str) -> str:
        """The text under `key`, which must be there."""
        value = self.required(key)
        if not isinstance(value, str) or not value.strip():
            raise InputError(self.place(key), f"{value!r:.60} is not a word", f'write {key} = "…"')
        return value

    def table(self, key: str) -> "Table":
        """The table under `key`, empty where absent."""
        name = f"{self.section}.{key}" if self.section else key
        return Table(self.data.get(key, {}), self.where, name)

    def names(self, key: str) -> tuple[str, ...] | None:
        """The list of words under `key`, None where the key is absent."""
        if key not in self.data:
            return None
        value = self.data[key]
        if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
            raise InputError(self.place(key), "is not a list of names", f'write {key} = ["…", "…"]')
        if twice := [item for i, item in enumerate(value) if item in value[:i]]:
            raise InputError(self.place(key), f"names {twice[0]} twice", "delete one")
        return tuple(value)


def unknown_key(place: str, known: tuple[str, ...], key: str) -> InputError:
    """The error for a key that nothing reads."""
    return InputError(place, "unknown key", suggestion(key, known, f"known: {', '.join(known)}"))


def read_number(entry: Any, place: str, default: Parameter) -> tuple[float, Parameter]:
    """The number and its row from `value` or `{ value = …, fixed = …, bounds = […], prior_std = … }`.

    `default` is the row where the file does not say; its unit is the number's, empty where a mechanism's may be any.
    """
    table = Table(entry if isinstance(entry, dict) else {"value": entry}, place, "")
    for key in table.data:
        if key == "standard_error":
            remedy = "delete it, or write prior_std = … to start from what an earlier fit found"
            raise InputError(f"{place}.{key}", "is what a fit answers, not what it reads", remedy)
        if key not in _NUMBER_KEYS:
            raise unknown_key(f"{place}.{key}", _NUMBER_KEYS, key)
    if "value" not in table.data:
        raise InputError(place, "has no value", "write { value = … }")
    value = read_finite(table.data["value"], place)
    low, high = read_bounds(table, (default.lower, default.upper), place)
    if not low <= value <= high:
        raise InputError(place, f"value {value:g} lies outside its bounds [{low:g}, {high:g}]", "mend one of them")
    row = dataclasses.replace(default, lower=low, upper=high, **_variation(table, place))
    row = dataclasses.replace(row, free=_freedom(table, place, default.free or row.varies))
    if row.varies and not row.free:
        raise InputError(place, "is fixed and differs by run", "delete fixed, or varies")
    usual = value if "prior_std" in table.data or not math.isfinite(row.prior_std) else row.prior_mean
    std, mean = read_prior(table, (row.prior_std, usual), place)
    return value, dataclasses.replace(row, prior_std=std, prior_mean=mean, unit=stated_unit(table, place, default.unit))


def read_bounds(table: Table, default: tuple[float, float], place: str) -> tuple[float, float]:
    """The bounds of a number, the `default` ones where its `table` has none."""
    if "bounds" not in table.data:
        return default
    value = table.data["bounds"]
    low, high = map(_real, value) if isinstance(value, list) and len(value) == 2 else (math.nan, math.nan)
    if not low < high:
        raise InputError(f"{place}.bounds", f"is {value!r:.60}", "write bounds = [low, high]")
    return low, high


def read_prior(table: Table, default: tuple[float, float], place: str) -> tuple[float, float]:
    """Standard deviation and mean of a number's prior, those of `default` where its `table` does not say."""
    std, mean = default
    if "prior_std" in table.data:
        std = _real(table.data["prior_std"])
        if not std > 0.0:
            raise InputError(f"{place}.prior_std", f"is {table.data['prior_std']!r:.60}", "give a positive number")
    if "prior_mean" in table.data:
        if not math.isfinite(std):
            raise InputError(f"{place}.prior_mean", "is given without prior_std", "add prior_std = …")
        mean = read_finite(table.data["prior_mean"], f"{place}.prior_mean")
    return std, mean


def _variation(table: Table, place: str) -> dict[str, Any]:
    """Whether a number differs by run, and its standard deviation between runs where its `table` gives one."""
    if "varies" not in table.data:
        if "spread" in table.data:
            raise InputError(f"{place}.spread", "is given without varies", 'add varies = "run"')
        return {}
    if table.data["varies"] != "run":
        raise InputError(f"{place}.varies", f"is {table.data['varies']!r:.60}", 'write varies = "run"')
    given = "spread" in table.data
    return {"varies": True, "spread": read_positive(table.data["spread"], f"{place}.spread") if given else 0.0}


def _freedom(table: Table, place: str, free: bool) -> bool:
    """Whether an estimator may move a number, `free` where its `table` does not say."""
    given = [key for key in ("fixed", "free") if key in table.data]
    if len(given) == 2:
        raise InputError(place, "has both fixed and free", "write one of them")
    for key in given:
        if not isinstance(table.data[key], bool):
            raise InputError(f"{place}.{key}", f"is {table.data[key]!r:.60}", "write true or false")
        return table.data[key] == (key == "free")
    return free


def stated_unit(table: Table, place: str, expected: str) -> str:
    """The unit of a number, refused where its `table` states one that is not `expected` or not SI."""
    if "unit" not in table.data:
        return expected
    place = f"{place}.unit"
    stated = read_unit(table.data["unit"], place, f"give the number in {expected}" if expected else "")
    if expected and not same_dimension(stated, expected):
        raise InputError(place, f"is {stated!r}, and the number is in {expected}", f'write unit = "{expected}"')
    return expected or stated


def read_unit(stated: Any, place: str, remedy: str = "") -> str:
    """An SI unit as text; `remedy` is what to do about one that is not SI."""
    if not isinstance(stated, str):
        raise InputError(place, f"{stated!r:.60} is not a word", 'write unit = "N" and the like')
    try:
        if not is_si(stated):
            what = f"is {stated!r}, and numbers of a vehicle file are in SI"
            raise InputError(place, what, remedy or f"give the number in {si_unit(stated) or '1'}")
    except UnknownUnit as error:
        raise InputError(place, str(error), error.remedy) from error
    return stated


def read_option(table: Table, key: str, field: dataclasses.Field) -> Any:
    """A static choice of an effect: a word, words, a positive size or an edge, as its `field` says."""
    if key not in table.data and field.default is not dataclasses.MISSING:
        return field.default
    value, form = table.required(key), field.type
    if form is str and not isinstance(value, str):
        raise InputError(table.place(key), f"{value!r:.60} is not a word", f'write {key} = "…"')
    if form is float and not (value := read_finite(value, table.place(key))) > 0.0 and "signed" not in field.metadata:
        raise InputError(table.place(key), f"is {value:g}", "give a positive number")
    return value if form in (str, float) else table.names(key)


def read_finite(value: Any, place: str) -> float:
    """A plain number of a size that can be computed with."""
    if not math.isfinite(number := _real(value)):
        raise InputError(place, f"{value!r:.60} is not a finite number", "give a number in SI units")
    if not computable(number):
        what = f"is {number:.3g}, and sizes from {1.0 / _LARGEST:g} to {_LARGEST:g} can be computed with"
        raise InputError(place, what, "give a number in SI units")
    return number


def computable(size: float) -> bool:
    """Whether a number is zero, or of a size that can be computed with."""
    return size == 0.0 or 1.0 / _LARGEST <= abs(size) <= _LARGEST


def read_positive(value: Any, place: str) -> float:
    """A plain number above zero."""
    if (size := read_finite(value, place)) <= 0.0:
        raise InputError(place, f"is {size:g}", "give a positive number")
    return size


def _real(value: Any) -> float:
    """`value` as a float, NaN where it is not one: TOML also holds whole numbers larger than any float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def read_column(column: Any, place: str, key: str) -> str:
    """The name of a recording's column."""
    if not isinstance(column, str) or not column.strip():
        raise InputError(place, f"{column!r:.60} is not a column name", f'write {key} = "column"')
    if re.search(r"[\[\]]", column):
        raise InputError(place, f"{column!r} has brackets", "name the column without its unit")
    return column
