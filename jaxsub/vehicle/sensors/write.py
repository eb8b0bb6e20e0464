"""`[outputs]` tables out, and the columns of `[inputs]` and `[prescribed]`."""

import itertools
from collections.abc import Callable
from typing import Any

import tomlkit

from .output import GEODETIC, Output
from .sensors import MOUNTING, Sensors

Said = Callable[[str], Any]


def output_tables(outputs: tuple[Output, ...], sensors: Sensors, said: Said) -> Any:
    """The tables of `outputs`; `said` gives what a file says of the number of that name."""
    section = tomlkit.table(is_super_table=True)
    for name, group in itertools.groupby(outputs, key=lambda output: output.table):
        section[name] = _table(name, tuple(group), sensors, said)
    return section


def _table(name: str, outputs: tuple[Output, ...], sensors: Sensors, said: Said) -> Any:
    table, first = tomlkit.table(), outputs[0]
    several, beams = bool(first.instrument), first.channel == "beam"
    if several or first.channel != name:
        table["channel"] = [o.channel for o in outputs] if several and not beams else first.channel
    if any(output.column != output.name for output in outputs):
        table["column"] = [output.column for output in outputs] if several else first.column
    sigmas = ["estimate" if output.sigma is None else output.sigma for output in outputs]
    table["sigma"] = sigmas if len(set(sigmas)) > 1 else sigmas[0]
    if first.unit:
        table["unit"] = first.unit
    if first.frame:
        table["frame"] = first.frame
    if first.wrap:
        table["wrap"] = first.wrap
    if any(first.lever_arm):
        table["lever_arm"] = list(first.lever_arm)
    if f"{name}.{MOUNTING[0]}" in sensors.numbers:
        table["mounting"] = [said(f"{name}.{angle}") for angle in MOUNTING]
    if beams:
        table["directions"] = [list(output.direction) for output in outputs]
    if first.density is not None:
        table["density"] = first.density
    if first.latitude is not None:
        table["latitude"] = first.latitude
    if first.channel in GEODETIC:
        table["origin"] = list(first.origin)
    for key in ("scale", "offset"):
        if f"{first.name}.{key}" in sensors.numbers:
            entries = [said(f"{output.name}.{key}") for output in outputs]
            table[key] = entries if several else entries[0]
    return table


def column_entry(name: str, column: str, unit: str | None, sensors: Sensors, said: Said) -> Any:
    """What a file says of an input or a prescribed motion: its column, with `unit`, scale and offset if it has any."""
    lines = {key: said(f"{name}.{key}") for key in ("scale", "offset") if f"{name}.{key}" in sensors.numbers}
    if unit is None and not lines:
        return column
    table = tomlkit.inline_table()
    table["column"] = column
    # that it has no dimension is said too: no unit is another thing
    if unit is not None:
        table["unit"] = unit
    table.update(lines)
    return table
