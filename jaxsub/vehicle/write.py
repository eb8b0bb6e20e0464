"""Vehicle files out: a vehicle to TOML."""

import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tomlkit

from ..effects import AbstractEffect, parameter_table
from ..effects.base import option_fields
from ..errors import OutputError
from ..parameters import Parameter
from ..storage import written_whole
from .actuators import Actuators, actuator_tables
from .assembly import BODY_KEYS, VECTORS
from .base import AbstractVehicle
from .own import OwnModel, source_of
from .sensors import column_entry, output_tables
from .submerged_body import ATTITUDES, CORIOLIS, SubmergedBody


def write_vehicle(vehicle: AbstractVehicle, path: str | Path, comment: str = "") -> None:
    """Write `vehicle` to the file `path` so that `read_vehicle` gives it back, to the last digit.

    It begins with the lines of `comment`. An older file stays as it was until the new one is whole. **Raises**
    `OutputError` where it cannot be written.
    """
    path = Path(path)
    try:
        with written_whole(path) as beside:
            beside.write_text(vehicle_text(vehicle, comment), encoding="utf-8")
    except OSError as error:
        raise OutputError(str(path), f"cannot be written ({error.strerror or error})", "check its folder") from error


def vehicle_text(vehicle: AbstractVehicle, comment: str = "") -> str:
    """The vehicle file of `vehicle` as text, which begins with the lines of `comment`."""
    layout, values = vehicle.layout, {name: float(v) for name, v in vehicle.values().items()}
    spreads = {name: float(spread) for name, spread in vehicle.spreads.items()}
    known = {name: spread if spread > 0.0 else 0.0 for name, spread in spreads.items()}
    rows = {row.name: dataclasses.replace(row, spread=known.get(row.name, 0.0)) for row in layout.parameters}
    document = tomlkit.document()
    for line in comment.splitlines():
        document.add(tomlkit.comment(line))
    document.update({"schema": 1, "name": layout.name, "kind": layout.kind})
    document.update(_equations(vehicle))
    # numbers in the order of the file that they are from, which compiled programs do not keep
    place = {name: index for index, name in enumerate(rows)}
    own = {name: values[name] for name in sorted(vehicle.own_values(), key=lambda name: place.get(name, len(place)))}
    tied = {tie.name: tie.text for tie in layout.ties}
    said = lambda name: tied.get(name) or _number_table(own[name], rows.get(name), Parameter(name, free=False))
    if isinstance(vehicle, SubmergedBody):
        document["body"] = _body_table(vehicle, own, said)
        if layout.geometry is not None:
            kind, sizes = layout.geometry
            document["geometry"] = {"kind": kind, **dict(sizes)}
        model = {"coriolis": vehicle.coriolis, "attitude": vehicle.attitude}
        usual = {"coriolis": CORIOLIS[0], "attitude": ATTITUDES[0]}
        if stated := {key: word for key, word in model.items() if word != usual[key]}:
            document["model"] = stated
    coefficients = tomlkit.table()
    devices = vehicle.actuators if isinstance(vehicle, SubmergedBody) else Actuators()
    for name in (name for name in own if name not in devices.values() | vehicle.sensors.numbers):
        if isinstance(vehicle, SubmergedBody) and name in _body_names():
            continue
        if name in tied:
            coefficients[name] = tied[name]
        else:
            row = rows.get(name, Parameter(name, free=False))
            unit = "" if isinstance(vehicle, SubmergedBody) else row.unit
            coefficients[name] = _number_table(own[name], row, Parameter(name), unit)
    document["coefficients"] = coefficients
    entry = lambda name, column: column_entry(name, column, dict(layout.input_units).get(name), vehicle.sensors, said)
    if layout.inputs:
        document["inputs"] = {name: entry(name, column) for name, column in layout.inputs}
    tables, stages = actuator_tables(devices, vehicle.effects, rows, tied, _number_table)
    if devices.items:
        document["actuators"] = tables
    if layout.prescribed:
        document["prescribed"] = {name: entry(name, column) for name, column in layout.prescribed}
    if layout.environment:
        document["environment"] = dict(layout.environment)
    document["outputs"] = output_tables(layout.outputs, vehicle.sensors, said)
    effects = [effect for effect in vehicle.effects if not any(effect is stage for stage in stages)]
    if effects:
        document["effects"] = tomlkit.aot()
    for effect in effects:
        document["effects"].append(_effect_table(effect, rows, tied))
    return tomlkit.dumps(document)


def _equations(vehicle: AbstractVehicle) -> dict[str, Any]:
    """The free equations, or the class that has them."""
    if isinstance(vehicle, OwnModel):
        return {"class": source_of(type(vehicle.model))}
    return {"dof": list(vehicle.layout.equations)}


def _body_names() -> set[str]:
    return {name for key in BODY_KEYS for name in VECTORS.get(key, (key,))}


def _body_table(vehicle: SubmergedBody, values: dict[str, float], said: Callable[[str], Any]) -> Any:
    table = tomlkit.table()
    for key in BODY_KEYS:
        if key in VECTORS and VECTORS[key][0] in values:
            table[key] = [said(name) for name in VECTORS[key]]
        elif key in values:
            table[key] = said(key)
    table["reference_density"] = vehicle.restoring.reference_density
    table["length"], table["diameter"] = vehicle.layout.length, vehicle.layout.diameter
    return table


def _effect_table(effect: AbstractEffect, rows: dict[str, Parameter], tied: dict[str, str]) -> Any:
    table = tomlkit.table()
    table["effect"] = effect.name
    for field in option_fields(type(effect)):
        if (value := getattr(effect, field.name)) != field.default:
            table[field.name.rstrip("_")] = list(value) if isinstance(value, tuple) else value
    table["expression"] = effect.expression
    symbols, numbers = effect.symbols(), parameter_table(effect)
    written = lambda field, row: (
        tied.get(row.name) or _number_table(float(getattr(effect, field)), rows.get(row.name), row)
    )
    table["parameters"] = {symbols[field]: written(field, row) for field, row in numbers.items()}
    return table


def _number_table(value: float, row: Parameter | None, default: Parameter, unit: str = "") -> Any:
    """A bare number where a body entry is plain, else an inline table of what differs from the `default` row."""
    row = row or default
    table = tomlkit.inline_table()
    table["value"] = value
    if row.free != default.free:
        table["fixed"] = not row.free
    if (row.lower, row.upper) != (default.lower, default.upper):
        table["bounds"] = [row.lower, row.upper]
    if row.prior_std != default.prior_std:
        table["prior_std"] = row.prior_std
    # read without it, the prior's mean is the value, or that of the effect's own prior
    mean = value if "prior_std" in table or not math.isfinite(row.prior_std) else default.prior_mean
    if math.isfinite(row.prior_std) and row.prior_mean != mean:
        table["prior_mean"] = row.prior_mean
    if row.varies:
        table["varies"] = "run"
        if row.spread:
            table["spread"] = row.spread
    if unit:
        table["unit"] = unit
    return value if not default.free and len(table) == 1 else table
