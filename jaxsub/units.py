"""Conversion between the units people write in files, in headers `name[unit]`, and the SI base units we compute in."""

import functools
import re
import threading
from typing import Any

import numpy as np

from jaxsub.errors import InputError, nearest
from jaxsub.unit_names import AMBIGUOUS, PHRASES, unit_name

TIME = "t"  # the column that holds the time
ACCELERATIONS = ("ax", "ay", "az")  # the columns that hold specific forces

_BUILDING = threading.Lock()
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
    "T",
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

# Unit text is evaluated by pint, where `9**9**9` would run for ever. So only a first factor and names with a one-digit
# power get that far.
_LONGEST = 60
_NUMBER = r"\d{1,9}(?:\.\d{1,9})?(?:[eE][+-]?\d\d?)?"
_NAME = r"degE[57]|g_?0|°?[^\W\d_](?:[^\W\d]*[^\W\d_])?|[°%℃℉]"
_TOKEN = re.compile(rf"\s*(?:(?P<name>{_NAME})(?:\s*(?:\^|\*\*)\s*|)(?P<power>[+-]?\d)?(?![\w^])|(?P<sign>[*/()-]))\s*")
# what stands for what in unit texts: powers as printers set them, letters that look alike, signs of a product
_LIKE = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻−µμº·⋅×•", "0123456789--uu°****")


class UnknownUnit(ValueError):
    """A text is no unit, or may mean several: `unit` is the text and `remedy` says what to write instead."""

    def __init__(self, unit: str, meanings: str = ""):
        self.unit = unit
        close = nearest(unit, _COMMON)
        self.remedy = f"did you mean {close!r}?" if close else "write it like m/s, deg or kg/m^3"
        if meanings:
            self.remedy = f"write {meanings}"
        super().__init__(f"unit {unit!r} is ambiguous" if meanings else f"unknown unit {unit!r}")


def to_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Convert `values` (any shape) from `unit` to SI base units, as new float64 values.

    An empty `unit` or `1` is dimensionless. A value too large for float64 becomes infinite. Raises UnknownUnit.
    """
    factor, given, base = _units(unit)
    with np.errstate(over="ignore", invalid="ignore"):
        return _convert(np.array(values, np.float64) * factor, given, base)


def from_si(values: np.ndarray, unit: str) -> np.ndarray:
    """Convert `values` (any shape) from SI base units to `unit`; the inverse of `to_si`. Raises UnknownUnit."""
    factor, given, base = _units(unit)
    return _convert(np.array(values, np.float64), base, given) / factor


def si_unit(unit: str) -> str:
    """Return the SI unit that `to_si` converts `unit` to, for reading: `rad/s` for `rpm`. Raises UnknownUnit."""
    return _shown(_units(unit)[2])


def is_si(unit: str) -> bool:
    """Whether numbers in `unit` are in SI already, as those in `N/(m/s)` are. Raises UnknownUnit."""
    factor, given, base = _units(unit)
    at = _convert(np.array([0.0, 1.0]), given, base) * factor
    return bool(at[0] == 0.0 and abs(at[1] - 1.0) < 1e-12)


def same_dimension(unit: str, other: str) -> bool:
    """Whether two units have one dimension, an angle counting as a plain number. Raises UnknownUnit."""
    return _units(unit)[1].dimensionality == _units(other)[1].dimensionality


def unit_rate(unit: str) -> str:
    """The SI unit of the rate of what has the SI unit `unit`, as `si_unit` writes it: `rad/s` for `rad`."""
    return _shown(_units(unit)[2] / _registry().Unit("second"))


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
    gravity = {"g": "g_n", "G": "g_n", "mg": "mg_n", "mG": "mg_n"}
    return gravity.get(unit.strip(), unit) if name in ACCELERATIONS else unit


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


def _shown(base: Any) -> str:
    return _pretty().get(base) or f"{base:~P}"


def _convert(values: np.ndarray, source: Any, target: Any) -> np.ndarray:
    with np.errstate(over="ignore", invalid="ignore"):
        return _registry().Quantity(values, source).to(target).magnitude


def _registry() -> Any:
    # threads that build one each would hold units that do not convert into each other
    with _BUILDING:
        return _built_registry()


@functools.cache
def _built_registry() -> Any:
    # Built on first use, because it takes a noticeable time, and our own, so that no other library's units leak in.
    import pint

    return pint.UnitRegistry()


@functools.cache
def _units(unit: str) -> tuple[float, Any, Any]:
    """Return `unit` as a factor and a pint unit, and the SI base unit that it converts to."""
    if len(unit) > _LONGEST:
        raise UnknownUnit(unit)
    factor, expression = _expression(unit)
    try:
        given = _registry().Quantity(_registry().parse_expression(expression))
        factor *= float(given.magnitude)
        return factor, given.units, _registry().Quantity(1.0, given.units).to_base_units().units
    except Exception as error:  # on malformed text pint's parser fails in many ways, assertions among them
        raise UnknownUnit(unit) from error


def _expression(unit: str) -> tuple[float, str]:
    """A unit text as a factor before an expression of pint's own names."""
    text = unit.translate(_LIKE).strip().rstrip(".")
    if text.lower() in PHRASES:
        return 1.0, PHRASES[text.lower()]
    # N.m and m.s-1 are products, deg_per_s and m per s quotients
    text = re.sub(r"(?<=[^\W_])\.(?=[^\W\d_])", "*", text)
    text = re.sub(r"(?<=[^\W_])(?:_per_|\s+per\s+)(?=[^\W_])", "/", text)
    first = re.match(rf"(?P<number>{_NUMBER})(?=$|[\s*/])\s*\*?", text)
    factor, text = (float(first["number"]), text[first.end() :]) if first else (1.0, text)
    if not factor:
        raise UnknownUnit(unit)
    parts: list[str] = []
    at = 0
    while at < len(text):
        if not (token := _TOKEN.match(text, at)):
            raise UnknownUnit(unit)
        at = token.end()
        parts += _part(unit, token, parts[-1] if parts else "1" if first and token["sign"] == "/" else "")
    whole = "".join(parts)
    if len(parts) > 1:  # in a product or quotient a temperature is a difference
        whole = whole.replace("degree_", "delta_degree_")
    return factor, (f"1{whole}" if whole.startswith("/") else whole) or "dimensionless"


def _part(unit: str, token: re.Match[str], before: str) -> list[str]:
    """A token of the text `unit` as parts of an expression, behind the part `before`."""
    sign = token["sign"]
    if sign in ("*", "/", ")", "-"):
        return ["*" if sign == "-" else sign]
    product = ["*"] if before and before not in "*/(" else []
    if sign:
        return [*product, sign]
    name = token["name"]
    if not (found := unit_name(name)):
        raise UnknownUnit(unit, AMBIGUOUS.get(name, ""))
    return [*product, f"({found})" + (f"**{int(token['power'])}" if token["power"] else "")]


@functools.cache
def _pretty() -> dict[Any, str]:
    return {_units(name)[2]: name for name in _PRETTY}
