"""Units of a recording's columns against the dimension of what a vehicle takes them for."""

from collections.abc import Iterator, Sequence

from ..effects import CHANNEL_UNITS
from ..errors import InputError
from ..recording import Recording
from ..units import ACCELERATIONS, si_unit, unit_rate
from .base import Layout
from .submerged_body import CURRENT

_ENVIRONMENT_UNITS = {"density": "kg/m^3", "ballast": "m^3", "temperature": "K", "altitude": "m"}
_ENVIRONMENT_UNITS |= dict.fromkeys(CURRENT, "m/s")
# by SI unit: what has it, and what to write in a header
_DIMENSIONS = {
    "rad": ("angle", "rad or deg"),
    "rad/s": ("angular rate", "rad/s, deg/s or rpm"),
    "m": ("length", "m"),
    "m/s": ("speed", "m/s or knot"),
    "m/s²": ("acceleration", "m/s^2 or g"),
    "N": ("force", "N"),
    "kg/m³": ("density", "kg/m^3"),
    "m³": ("volume", "m^3"),
    "Pa": ("pressure", "Pa, kPa or dbar"),
    "K": ("temperature", "degC or K"),
}
_NAMES = {
    "1": "a plain number", "rad": "radian", "m": "metre", "s": "second", "kg": "kilogram", "N": "newton", "V": "volt",
    "A": "ampere", "W": "watt", "K": "kelvin", "Pa": "pascal", "T": "tesla", "N m": "newton metre", "1/s": "hertz",
}  # fmt: skip


def check_units(layout: Layout, recordings: Sequence[Recording]) -> None:
    """Refuse recordings whose columns have units that a vehicle of `layout` cannot take.

    A body's columns have the dimension of their channel, actuator, motion or surroundings. A mechanism's coordinate may
    have any, the same in all recordings, and its rate that per second. A column whose file states no unit is SI.

    **Raises** `InputError` for the first column of another dimension, and for one that cannot be used at all.
    """
    taken = dict(_taken(layout))
    for recording in recordings:
        for column, expected in taken.items():
            if column in recording.unusable:
                recording.column(column)
            if expected and (stated := recording.units.get(column)):
                _check(recording, column, stated, si_unit(expected) or "1")
    if layout.kind == "mechanism":
        _check_alike(list(taken), recordings)
        for recording in recordings:
            _check_rates(layout, recording)


def _taken(layout: Layout) -> Iterator[tuple[str, str]]:
    """The columns that a vehicle takes from a recording, each with its unit, empty where it may have any."""
    body = layout.kind == "submerged-body"
    for name, column in layout.inputs:
        yield column, layout.input_unit(name)
    for pairs, units in ((layout.prescribed, CHANNEL_UNITS), (layout.environment, _ENVIRONMENT_UNITS)):
        for name, column in pairs:
            yield column, units[name] if body else ""
    for output in layout.outputs:
        yield output.column, layout.unit(output.name)


def _check(recording: Recording, column: str, stated: str, expected: str) -> None:
    if stated == expected:
        return
    name = _NAMES.get(expected, expected)
    dimension, remedy = _DIMENSIONS.get(expected, (f"quantity in {name}", expected))
    if expected == "m/s²" and stated == "kg" and column not in ACCELERATIONS:
        remedy = "m/s^2 or g_n, since g is gram there"
    article = "an" if dimension[0] in "aeiou" else "a"
    what = f"{_NAMES.get(stated, stated)} is not the unit of {article} {dimension}"
    raise InputError(f"{recording.source}, column {column!r}", what, f"head it {column}[…] in {remedy}")


def _check_alike(columns: list[str], recordings: Sequence[Recording]) -> None:
    first: dict[str, Recording] = {}
    for recording in recordings:
        for column in columns:
            if not (unit := recording.units.get(column)):
                continue
            other = first.setdefault(column, recording)
            if (before := other.units[column]) != unit:
                where = f"{recording.source}, column {column!r}"
                raise InputError(where, f"is in {unit}, in {other.source} in {before}", "give all runs one unit")


def _check_rates(layout: Layout, recording: Recording) -> None:
    for coordinate in layout.equations:
        unit, rate = recording.units.get(coordinate), recording.units.get(f"{coordinate}_rate")
        shown = {coordinate, f"{coordinate}_rate"} <= {*layout.channels, *layout.held, *layout.interpolated}
        if shown and unit and rate and rate != unit_rate(unit):
            where = f"{recording.source}, column '{coordinate}_rate'"
            raise InputError(where, f"is in {rate}, and {coordinate!r} in {unit}", f"give it in {unit_rate(unit)}")
