"""`[actuators.NAME]` tables out."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import tomlkit

from ...effects import AbstractActuator, AbstractEffect, number_fields, parameter_table
from ...parameters import Parameter
from .base import Actuator, Actuators
from .curve import order
from .keys import Flag, Function, Number, Pair, Vector, Word
from .stages import stages_of

Written = Callable[[float, Parameter | None, Parameter], Any]


def actuator_tables(
    actuators: Actuators,
    effects: Sequence[AbstractEffect],
    rows: Mapping[str, Parameter],
    tied: Mapping[str, str],
    written: Written,
) -> tuple[Any, list[AbstractActuator]]:
    """The tables of `actuators`, and those of `effects` that are said there.

    `rows` and `tied` have the rows of numbers and the expressions of those that follow others, by name; `written` makes
    what a file says of a value, its row and the row that a file need not state.
    """
    section, said = tomlkit.table(is_super_table=True), []
    for item in actuators.items:
        table = _table(item, rows, tied, written)
        stages = {key: e for key, e in stages_of(item, effects).items() if not any(e is one for one in said)}
        for key, effect in stages.items():
            (field,) = (one.name for one in number_fields(effect))
            own = parameter_table(effect)[field]
            default = Parameter(own.name, free=False, lower=own.lower)
            value = float(getattr(effect, field))
            table[key] = tied.get(f"{item.name}.{key}") or written(value, rows.get(own.name), default)
        said += stages.values()
        section[item.name] = table
    return section, said


def _table(item: Actuator, rows: Mapping[str, Parameter], tied: Mapping[str, str], written: Written) -> Any:
    table = tomlkit.table()
    table["kind"] = item.kind
    if item.input != ((item.name, 1.0),):
        one = len(item.input) == 1 and item.input[0][1] == 1.0
        table["input"] = item.input[0][0] if one else _inline(item.input)
    if item.limits != (-math.inf, math.inf):
        table["limits"] = list(item.limits)

    def said(label: str) -> Any:
        name = f"{item.name}.{label}"
        row = rows.get(name)
        return tied.get(name) or written(float(item.numbers[label]), row, Parameter(name, free=False))

    for key, spec in item.keys.items():
        if isinstance(spec, Number) and key in item.numbers:
            table[key] = said(key)
        elif isinstance(spec, Pair) and f"{key}_{spec.labels[0]}" in item.numbers:
            table[key] = [said(f"{key}_{label}") for label in spec.labels]
        elif isinstance(spec, Function):
            if count := order(key, item.numbers):
                table[key] = [said(f"{key}_{power}") for power in range(count)]
            elif points := getattr(item, key):
                table[key] = _inline(zip(spec.columns, map(list, points), strict=True))
        elif isinstance(spec, Vector):
            table[key] = list(getattr(item, key))
        elif isinstance(spec, Word | Flag) and getattr(item, key) != spec.default:
            table[key] = getattr(item, key)
    return table


def _inline(pairs: Any) -> Any:
    table = tomlkit.inline_table()
    for key, value in pairs:
        table[key] = value
    return table
