"""Reading the pieces of a vehicle file, with errors that say where, what and what to do."""

import dataclasses
import math
from typing import Any

from ..errors import InputError, nearest
from ..parameters import Parameter
from .base import Output

_NUMBER_KEYS = ("value", "fixed", "free", "bounds", "prior_std", "unit", "standard_error")


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
            close = nearest(str(value), known)
            hint = f"did you mean {close}?" if close else f"choose one of {', '.join(known)}"
            raise InputError(self.place(key), f"{value!r} is not known", hint)
        return value

    def table(self, key: str) -> "Table":
        """The table under `key`, empty where absent."""
        name = f"{self.section}.{key}" if self.section else key
        return Table(self.data.get(key, {}), self.where, name)

    def names(self, key: str) -> tuple[str, ...] | None:
        """The list of words under `key`, or None."""
        value = self.data.get(key)
        if value is None:
            return None
        if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
            raise InputError(self.place(key), "is not a list of names", f'write {key} = ["…", "…"]')
        if twice := [item for i, item in enumerate(value) if item in value[:i]]:
            raise InputError(self.place(key), f"names {twice[0]} twice", "delete one")
        return tuple(value)


def unknown_key(place: str, known: tuple[str, ...], key: str) -> InputError:
    """The error for a key that nothing reads."""
    close = nearest(key, known)
    return InputError(place, "unknown key", f"did you mean {close}?" if close else f"known: {', '.join(known)}")


def read_number(
    name: str, entry: Any, place: str, *, free: bool, lower: float = -math.inf, unit: str = ""
) -> tuple[float, Parameter]:
    """The number and its row from `value` or `{ value = …, fixed = …, bounds = […], prior_std = … }`.

    `free` says whether a number is free where the file does not say.
    """
    table = Table(entry if isinstance(entry, dict) else {"value": entry}, place, "")
    for key in table.data:
        if key not in _NUMBER_KEYS:
            raise unknown_key(f"{place}.{key}", _NUMBER_KEYS, key)
    if "value" not in table.data:
        raise InputError(place, "has no value", "write { value = … }")
    value = _finite(table.data["value"], place)
    fixed = table.data.get("fixed", not table.data.get("free", free))
    if not isinstance(fixed, bool):
        raise InputError(f"{place}.fixed", f"is {fixed!r:.60}", "write true or false")
    low, high = _bounds(table.data.get("bounds", [lower, math.inf]), place)
    if not low <= value <= high:
        raise InputError(place, f"value {value:g} lies outside its bounds [{low:g}, {high:g}]", "mend one of them")
    prior = _real(table.data.get("prior_std", math.inf))
    if not prior > 0.0:
        raise InputError(f"{place}.prior_std", f"is {table.data['prior_std']!r:.60}", "give a positive number")
    return value, Parameter(name, unit, not fixed, low, high, prior, value)


def read_option(table: Table, key: str, field: dataclasses.Field) -> Any:
    """A static choice of an effect: a word, words, a positive size or an edge, as its `field` says."""
    if key not in table.data and field.default is not dataclasses.MISSING:
        return field.default
    value, form = table.required(key), field.type
    if form is str and not isinstance(value, str):
        raise InputError(table.place(key), f"{value!r} is not a word", f'write {key} = "…"')
    if form is float and not (value := _finite(value, table.place(key))) > 0.0 and "signed" not in field.metadata:
        raise InputError(table.place(key), f"is {value:g}", "give a positive number")
    return value if form in (str, float) else table.names(key)


def _finite(value: Any, place: str) -> float:
    if not math.isfinite(number := _real(value)):
        raise InputError(place, f"{value!r:.60} is not a finite number", "give a number in SI units")
    return number


def _real(value: Any) -> float:
    """`value` as a float, NaN where it is not one: TOML also holds whole numbers larger than any float."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def _bounds(value: Any, place: str) -> tuple[float, float]:
    low, high = map(_real, value) if isinstance(value, list) and len(value) == 2 else (math.nan, math.nan)
    if not low < high:
        raise InputError(f"{place}.bounds", f"is {value!r:.60}", "write bounds = [low, high]")
    return low, high


def read_pairs(table: Table) -> tuple[tuple[str, str], ...]:
    """(name in the model, column of the recording) pairs of `[inputs]` and its like."""
    for key, column in table.items():
        if not isinstance(column, str):
            raise InputError(table.place(key), f"{column!r} is not a column name", f'write {key} = "column"')
    return tuple(table.items())


def read_outputs(table: Table) -> tuple[Output, ...]:
    """The measured channels of `[outputs.*]`."""
    outputs = []
    for channel in table.data:
        entry = table.table(channel)
        entry.only(("sigma", "lever_arm"))
        sigma = entry.data.get("sigma", "estimate")
        if sigma != "estimate":
            sigma = _finite(sigma, entry.place("sigma"))
            if sigma <= 0.0:
                raise InputError(entry.place("sigma"), f"is {sigma:g}", 'give a positive number or "estimate"')
        arm = entry.data.get("lever_arm", [0.0, 0.0, 0.0])
        if not isinstance(arm, list) or len(arm) != 3:
            raise InputError(entry.place("lever_arm"), f"is {arm!r}", "give three numbers in m")
        x, y, z = (_finite(item, entry.place("lever_arm")) for item in arm)
        outputs.append(Output(channel, None if sigma == "estimate" else sigma, (x, y, z)))
    if not outputs:
        raise InputError(f"{table.where}: outputs", "names no measured channel", "add [outputs.r] and the like")
    return tuple(outputs)
