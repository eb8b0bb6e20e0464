"""Conversion between the units people write in files, in headers `name[unit]`, and the SI base units we compute in."""

import functools
import re
from typing import Any

import numpy as np

from jaxsub.errors import InputError, nearest

TIME = "t"  # the column that holds the time
ACCELERATIONS = ("ax", "ay", "az")  # the columns that hold specific forces

_COMMON = (
    "m", "cm", "mm", "km", "ft", "s", "ms", "min", "hour", "rad", "deg", "degree", "m/s", "knot", "rad/s", "deg/s",
    "rpm", "Hz", "m/s^2", "g", "kg", "tonne", "N", "kN", "lbf", "N m", "Pa", "kPa", "bar", "dbar", "psi", "m^3", "cm^3",
    "liter", "kg/m^3", "K", "degC", "degF", "V", "mV", "A", "W", "percent", "1",
)  # fmt: skip
_PRETTY = (
    "N",
    "N m",
    "Pa",
    "V",
    "W",
    "kg/m³",
    "m³",
    "m²",
    "m",
    "s",
    "kg",
    "K",
    "A",
    "rad",
    "m/s",
    "m/s²",
    "rad/s",
    "rad/s²",
)

# Unit text is evaluated by pint, where `9**9**9` would run for ever. So only names with a one-digit power get that far.
_FACTOR = r"(?:1|%|[^\W\d]\w*|°\w*)(?:\s*(?:\^|\*\*)\s*-?\d)?"
_SAFE = re.compile(rf"{_FACTOR}(?:(?:\s*[*/·]\s*|\s+){_FACTOR})*")
_LONGEST = 60

# `m s-2`, the way NetCDF conventions write a power.
_BARE_POWER = re.compile(r"(?<=[^\W\d_])(-?\d)(?!\w)")


class UnknownUnit(ValueError):
    """A text is no unit: `unit` is the text and `remedy` says what to write instead."""

    def __init__(self, unit: str):
        self.unit = unit
        close = nearest(unit, _COMMON)
        self.remedy = f"did you mean {close!r}?" if close else "write it like m/s, deg or kg/m^3"
        super().__init__(f"unknown unit {unit!r}")


def to_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Convert `values` (any shape) from `unit` to SI base units, as new float64 values.

    An empty `unit` or `1` is dimensionless. A value too large for float64 becomes infinite. Raises UnknownUnit.
    """
    given, base = _units(unit)
    return _convert(values, given, base)


def from_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Convert `values` (any shape) from SI base units to `unit`; the inverse of `to_si`. Raises UnknownUnit."""
    given, base = _units(unit)
    return _convert(values, base, given)


def si_unit(unit: str) -> str:
    """Return the SI unit that `to_si` converts `unit` to, for reading: `rad/s` for `rpm`. Raises UnknownUnit."""
    _, base = _units(unit)
    return _pretty().get(base) or f"{base:~P}"


def check_time_unit(where: str, unit: str) -> None:
    """Raise InputError, at `where`, unless `unit` is a unit of time; UnknownUnit when it is none at all."""
    if si_unit(unit) != "s":
        raise InputError(where, f"{unit!r} is no unit of time", f"write {TIME}[s]")


def split_header(header: str) -> tuple[str, str | None]:
    """The name and the unit of a header `name[unit]`, the unit None where there are no brackets."""
    match = re.fullmatch(r"([^\[\]]*)\[([^\[\]]*)\]", header.strip())
    return (match[1].strip(), match[2]) if match else (header.strip(), None)


def column_unit(name: str, unit: str) -> str:
    """What `unit` means over the column `name`: `g` is standard gravity where that is an acceleration, else gram."""
    return {"g": "g_n", "mg": "mg_n"}.get(unit.strip(), unit) if name in ACCELERATIONS else unit


def column_to_si(where: str, name: str, values: np.ndarray, unit: str) -> tuple[np.ndarray, str]:
    """The samples of a column `name` in SI and their SI unit, `1` where it has no dimension.

    Raises InputError, at `where`, for an unknown unit and for a time column `t` in a unit that is not one of time.
    """
    unit = re.sub(r"\s+since\s.*", "", unit)  # a NetCDF time; when the run took place does not matter here
    try:
        if name == TIME:
            check_time_unit(where, unit)
        unit = column_unit(name, unit)
        return to_si(values, unit), si_unit(unit) or "1"
    except UnknownUnit as error:
        raise InputError(where, str(error), error.remedy) from error


def _convert(values: np.ndarray, source: Any, target: Any) -> np.ndarray:
    with np.errstate(over="ignore", invalid="ignore"):
        return _registry().Quantity(np.array(values, np.float64), source).to(target).magnitude


@functools.cache
def _registry() -> Any:
    # Built on first use, because it takes a noticeable time, and our own, so that no other library's units leak in.
    import pint

    return pint.UnitRegistry()


@functools.cache
def _units(unit: str) -> tuple[Any, Any]:
    """Return `unit` and the SI base unit it converts to, as pint units."""
    text = _BARE_POWER.sub(r"**\1", unit.strip())
    if len(text) > _LONGEST or not _SAFE.fullmatch(re.sub(r"[()]", "", text) or "1"):
        raise UnknownUnit(unit)
    try:
        given = _registry().parse_units(text)
        return given, _registry().Quantity(1.0, given).to_base_units().units
    except Exception as error:  # on malformed text pint's parser fails in many ways, assertions among them
        raise UnknownUnit(unit) from error


@functools.cache
def _pretty() -> dict[Any, str]:
    return {_units(name)[1]: name for name in _PRETTY}
