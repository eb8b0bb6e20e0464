"""`[actuators.NAME]` tables in."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...effects import AbstractActuator
from ...errors import InputError, nearest
from ...parameters import Parameter, number
from ...units import same_dimension
from ..schema import Table, read_finite
from ..ties import Tie, is_tied, read_entry
from .ballast import Ballast, MovingMass
from .base import Actuator, Actuators
from .keys import Flag, Function, Number, Pair, Vector, Word, read_limits
from .propeller import Propeller
from .stages import STAGES, read_stages
from .surfaces import Fin, Rudder
from .thruster import Generic, Thruster

KINDS: dict[str, type[Actuator]] = {
    kind.kind: kind for kind in (Fin, Thruster, Propeller, Rudder, Ballast, MovingMass, Generic)
}
_COMMON = ("kind", "input", "limits", *STAGES)
_MOST = 100
_HIGHEST = 20  # coefficients of a polynomial


@dataclasses.dataclass
class Reading:
    """What the `[actuators]` of a file say, gathered table by table.

    **Fields**

    - `actuators`: the devices. `numbers`: value and row of each of their numbers. `ties`: those that follow others.
    - `stages`: what stands before them, with the row of its number.
    - `input_units`: SI units of inputs, stated or those of the actuators that they command.
    """

    actuators: Actuators
    numbers: dict[str, tuple[float, Parameter]]
    ties: list[Tie]
    stages: list[tuple[AbstractActuator, Parameter]]
    input_units: dict[str, str]


def read_actuators(table: Table, inputs: tuple[str, ...], units: Mapping[str, str], folder: Path) -> Reading:
    """The actuators of a body.

    `inputs` are the names of `[inputs]` and `units` their SI units where known; `folder` holds the files of curves.

    **Raises** `InputError` for a key that the kind of actuator has not, an input that there is not, and numbers that
    do not go together.
    """
    if len(table.data) > _MOST:
        raise InputError(f"{table.where}: {table.section}", f"are {len(table.data)}", f"give {_MOST} at most")
    found = Reading(Actuators(), {}, [], [], dict(units))
    for name in table.data:
        item = _read(table.table(name), name, inputs, found, folder)
        found.actuators = Actuators((*found.actuators.items, item))
    beside = {item.name: item for item in found.actuators.items}
    for item in found.actuators.items:
        if wrong := item.check(beside):
            key, what, remedy = wrong
            raise InputError(table.table(item.name).place(key), what, remedy)
    return found


def _read(table: Table, name: str, inputs: tuple[str, ...], found: Reading, folder: Path) -> Actuator:
    kind = KINDS[table.choice("kind", tuple(KINDS))]
    table.only((*_COMMON, *kind.keys))
    if not name.isidentifier():
        raise InputError(f"{table.where}: {table.section}", "is not a word", "use letters, digits and _")
    fixed: dict[str, Any] = {}
    listed: dict[str, tuple[Any, str, str]] = {}  # of each number: what the file says, where, and its key
    for key, spec in kind.keys.items():
        if key not in table.data:
            if spec.required:
                table.required(key)
            continue
        entry, place = table.data[key], table.place(key)
        if isinstance(spec, Number):
            listed[key] = entry, place, key
        elif isinstance(spec, Pair):
            low, high = entry if isinstance(entry, list) and len(entry) == 2 else _both(entry, spec, place)
            listed |= {f"{key}_{label}": (one, place, key) for label, one in zip(spec.labels, (low, high), strict=True)}
        elif isinstance(spec, Function):
            if not isinstance(entry, list):
                fixed[key] = spec.points(table, key, folder)
                continue
            if not 1 <= len(entry) <= _HIGHEST:
                raise InputError(place, f"has {len(entry)} coefficients", f"give 1 to {_HIGHEST}")
            listed |= {f"{key}_{power}": (one, place, key) for power, one in enumerate(entry)}
        elif isinstance(spec, Word):
            fixed[key] = spec.read(table, key)
        elif isinstance(spec, Vector | Flag):
            fixed[key] = spec.read(entry, place)
    if "limits" in table.data:
        fixed["limits"] = read_limits(table.data["limits"], table.place("limits"))
    blank = dict.fromkeys(listed, number(0.0))
    item = kind(name=name, input=_input(table, name, inputs), numbers=blank, **fixed)
    unit = _command_unit(item, table, found.input_units)
    for label, (entry, place, key) in listed.items():
        found.numbers[f"{name}.{label}"] = _number(item, f"{name}.{label}", key, entry, place, unit, found.ties)
    found.stages += read_stages(table, item, unit, found.ties)
    values = {full: number(value) for full, (value, _) in found.numbers.items()}
    return Actuators((item,)).with_values(values).items[0]


def _number(
    item: Actuator, name: str, key: str, entry: Any, place: str, unit: str, ties: list[Tie]
) -> tuple[float, Parameter]:
    row = Parameter(name, item.unit_of(key, unit), free=False)
    value, row = read_entry(name, entry, place, row, "actuators", ties)
    spec = item.keys[key]
    if isinstance(spec, Number) and spec.positive and value <= 0.0 and not is_tied(entry):
        raise InputError(place, f"is {value:g}", "give a positive number")
    return value, row


def _both(entry: Any, spec: Pair, place: str) -> tuple[Any, Any]:
    """Both numbers of a pair from one."""
    if isinstance(entry, list):
        raise InputError(place, f"is {entry!r:.60}", f"give one number or [{', '.join(spec.labels)}]")
    if spec.sign > 0:
        return entry, entry
    return -read_finite(entry, place), read_finite(entry, place)


def _input(table: Table, name: str, inputs: tuple[str, ...]) -> tuple[tuple[str, float], ...]:
    """The inputs of an actuator: those it names, else the one of its own name."""
    entry, place = table.data.get("input", name), table.place("input")
    if isinstance(entry, dict) and entry:
        pairs = tuple((key, read_finite(weight, f"{place}.{key}")) for key, weight in entry.items())
    elif isinstance(entry, str):
        pairs = ((entry, 1.0),)
    else:
        raise InputError(place, f"is {entry!r:.60}", 'write input = "NAME" or input = { NAME = 0.7, OTHER = -0.7 }')
    for one, _ in pairs:
        if one not in inputs:
            close = nearest(one, inputs)
            hint = f"did you mean {close}? " if close else ""
            raise InputError(place, f"{one} is not under [inputs]", f'{hint}write {one} = "column" there')
    return pairs


def _command_unit(item: Actuator, table: Table, units: dict[str, str]) -> str:
    """The SI unit of the inputs of an actuator, which is that of its command where it has one."""
    for one, _ in item.input if item.input_unit else ():
        unit = units.setdefault(one, item.input_unit)
        if not same_dimension(unit, item.input_unit):
            remedy = "add gain, forward or thrust" if isinstance(item, Thruster) else "mend one of them"
            raise InputError(table.place("input"), f"{one} is in {unit}, not in {item.input_unit}", remedy)
    return units.get(item.input[0][0], "")
