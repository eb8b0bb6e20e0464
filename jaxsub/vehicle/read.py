"""Vehicle files in: TOML to a vehicle."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..effects import (
    EQUATIONS,
    STANDARD_DENSITY,
    AbstractEffect,
    RunVariation,
    SmoothForce,
    derivative,
    parameter_table,
    vocabulary,
    with_numbers,
)
from ..effects.base import option_fields
from ..effects.derivatives import INPUT_UNITS
from ..effects.motion import quantity_of
from ..errors import InputError
from ..parameters import Parameter
from ..units import same_dimension
from .actuators import read_actuators
from .assembly import BODY_KEYS, VECTORS, Vehicle, VehicleParts, build
from .checks import check_count
from .coefficient_units import coefficient_unit
from .initial import read_geometry
from .own import Model, channels_of, loaded
from .scales import check_scaled, read_scales, scaled
from .schema import Table, read_number, read_option, unknown_key
from .sensors import quantities_of
from .sensors.read import Reading, read_columns, read_outputs
from .submerged_body import ATTITUDES, CORIOLIS
from .ties import Tie, read_entry
from .toml import check_tree, read_toml

_TOP = ("schema", "name", "kind", "dof", "class", "coefficients", "inputs", "environment", "outputs", "effects")
_OF_BODY = ("body", "geometry", "model", "prescribed", "actuators")
_SIZES = {"length": "m", "diameter": "m", "reference_density": "kg/m^3"}
_MOST_EFFECTS = 100


def read_vehicle(path: str | Path, effects: Sequence[type[AbstractEffect]] = ()) -> Vehicle:
    """The vehicle in the file at `path`, which may have `effects` of a user's own besides those of the vocabulary.

    **Raises** `InputError` that names the file and the key for anything that a vehicle file may not hold.
    """
    return vehicle_from(read_toml(Path(path)), str(path), effects, Path(path).parent)


def vehicle_from(
    data: dict[str, Any],
    where: str,
    effects: Sequence[type[AbstractEffect]] = (),
    folder: Path | None = None,
    model: type[Model] | Model | None = None,
) -> Vehicle:
    """The vehicle described by `data`, a parsed vehicle file; `where` names it in errors, `effects` are a user's own.

    `folder` holds the files that it names, the working directory where absent. `model` has the equations of a vehicle
    of kind `model`, in place of the file's class: a class, or a model whose numbers the file gives anew.
    **Raises** `InputError` as `read_vehicle` does.
    """
    check_tree(data, where)
    top = Table(data, where, "")
    if type(top.required("schema")) is not int or data["schema"] != 1:
        raise InputError(f"{where}: schema", f"is {data['schema']!r:.60}", "this version reads schema = 1")
    kind = top.choice("kind", ("submerged-body", "mechanism", "model"))
    _refuse_others(top, kind)
    top.only((*_TOP, *_OF_BODY))
    if kind == "model" and model is None:
        model = loaded(top.word("class"), folder or Path(), top.place("class"))
    tied: list[Tie] = []
    body, extra = _read_body(top, tied) if kind == "submerged-body" else ({}, {})
    if kind == "mechanism":
        top.required("dof")
        check_count(top.names("dof") or (), where)
    measured = Reading()
    inputs, units = _read_inputs(top.table("inputs"), kind == "submerged-body", measured)
    names = tuple(name for name, _ in inputs)
    devices = read_actuators(top.table("actuators"), names, units, folder or Path())
    coefficients, system = _read_coefficients(
        top.table("coefficients"), kind == "submerged-body", devices.input_units, tied
    )
    prescribed, _ = read_columns(top.table("prescribed"), ("scale", "offset"), measured)
    environment, _ = read_columns(top.table("environment"), (), measured)
    shown = () if model is None else channels_of(model, top.where)
    shown = shown or tuple(form for q in top.names("dof") or () for form in (q, f"{q}_rate"))
    read_outputs(top.table("outputs"), shown, kind == "submerged-body", measured)
    numbers = body | coefficients | devices.numbers
    # those with a symbol have their units by it
    named = [name for name in names if name in devices.input_units and not (body and name in INPUT_UNITS)]
    quantities = quantities_of(measured.outputs, kind == "submerged-body")
    entries = data.get("effects", [])
    # only for a file with effects, since the vocabulary opens the metadata of every installed package
    known = (*vocabulary(), SmoothForce, *effects) if entries else ()
    # a number that differs by run says so itself, and is no entry
    kinds = {kind.name: kind for kind in known if kind is not RunVariation}
    built_in, effect_rows = _read_effects(entries, where, kinds, quantities, tied)
    coriolis, attitude = _read_model(top.table("model"))
    parts = VehicleParts(
        where=where,
        name=top.word("name"),
        kind=kind,
        dof=top.names("dof"),
        numbers=numbers,
        hull=extra,
        geometry=read_geometry(top.table("geometry"), _sizes(body, extra)),
        model=model,
        coriolis=coriolis,
        attitude=attitude,
        system=system,
        ties=(*tied, *devices.ties, *measured.ties),
        inputs=inputs,
        input_units={name: devices.input_units[name] for name in named},
        actuators=devices.actuators,
        prescribed=prescribed,
        environment=environment,
        outputs=tuple(measured.outputs),
        sensor_numbers=measured.numbers,
        effects=(*(effect for effect, _ in devices.stages), *built_in),
        effect_rows=(*(row for _, row in devices.stages), *effect_rows),
    )
    return build(parts)


def _sizes(body: dict[str, tuple[float, Parameter]], hull: dict[str, float]) -> dict[str, float]:
    """What `[body]` says of sizes, by the names that a geometry has for them."""
    known = {name: value for name, (value, _) in body.items()} | hull
    named = {name: known[name] for name in ("mass", "speed", "length", "diameter") if name in known}
    return named | {"density": known.get("reference_density", STANDARD_DENSITY)}


def _refuse_others(top: Table, kind: str) -> None:
    """Refuse the parts of a file that belong to another kind than its own."""
    for key in _OF_BODY if kind != "submerged-body" else ():
        if key in top.data:
            remedy = f"delete it; a {kind} has [coefficients], and [environment] for what its effects read"
            raise InputError(top.place(key), "is a part of a submerged body", remedy)
    if kind == "model" and "dof" in top.data:
        raise InputError(top.place("dof"), "is of a body or a mechanism", "delete it; a model's class names its states")
    if kind != "model" and "class" in top.data:
        raise InputError(top.place("class"), f"is given beside kind = {kind!r}", 'write kind = "model", or delete it')


def _read_model(table: Table) -> tuple[str, str]:
    """Which products of velocities `[model]` has, and how it says the attitude."""
    table.only(("coriolis", "attitude"))
    chosen = lambda key, known: table.choice(key, known) if key in table.data else known[0]
    return chosen("coriolis", CORIOLIS), chosen("attitude", ATTITUDES)


def _read_inputs(table: Table, body: bool, measured: Reading) -> tuple[tuple[tuple[str, str], ...], dict[str, str]]:
    """The pairs of `[inputs]`, and the SI units of those for which that is known."""
    pairs, stated = read_columns(table, ("unit", "scale", "offset"), measured)
    known = {name: INPUT_UNITS[name] for name, _ in pairs if body and name in INPUT_UNITS}
    for name, unit in known.items():
        if name in stated and not same_dimension(stated[name], unit):
            place = f"{table.place(name)}.unit"
            raise InputError(place, f"is {stated[name]!r}, and {name} is in {unit}", f'write unit = "{unit}"')
    return pairs, stated | known


def _read_coefficients(
    table: Table, body: bool, units: dict[str, str], ties: list[Tie]
) -> tuple[dict[str, tuple[float, Parameter]], str]:
    """The numbers of `[coefficients]` in SI, and the system in which the file gives them in words; ties go into `ties`.

    In a file with a `system` a number that states its `unit` is in SI all the same, and so is one by an input that has
    no symbol. `units` has the units of such inputs.
    """
    scales = read_scales(table.table("system")) if body and "system" in table.data else None
    numbers = {}
    for name, entry in table.items():
        if name == "system" and scales is not None:
            continue
        place, unit = table.place(name), coefficient_unit(name, units) if body else ""
        stated = isinstance(entry, dict) and "unit" in entry
        term = derivative(name)
        scale = scales.unit(term) if scales and not stated and term is not None and term.dimensional else 1.0
        number = read_entry(name, entry, place, Parameter(name, unit), "coefficients", ties, scale)
        numbers[name] = scaled(*number, scale)
        check_scaled(numbers[name][0], place)
    return numbers, "" if scales is None else scales.text


def _read_body(top: Table, ties: list[Tie]) -> tuple[dict[str, tuple[float, Parameter]], dict[str, float]]:
    """The numbers of `[body]`, vectors taken apart, and the hull's sizes; ties go into `ties`."""
    body = top.table("body")
    body.only(BODY_KEYS)
    numbers, hull = {}, {}
    for key, entry in body.items():
        place = f"{body.where}: body.{key}"
        if key in VECTORS:
            if not isinstance(entry, list) or len(entry) != 3:
                raise InputError(place, "is not three numbers", f"give {key} = [ , , ]")
            for name, item in zip(VECTORS[key], entry, strict=True):
                row = Parameter(name, coefficient_unit(name), False)
                numbers[name] = read_entry(name, item, f"{place} ({name})", row, "body", ties)
        elif key in _SIZES:
            if isinstance(entry, dict) and (extra := [k for k in entry if k not in ("value", "unit")]):
                raise InputError(f"{place}.{extra[0]}", f"{key} is not estimated", f"write {key} = …")
            hull[key], _ = read_number(entry, place, Parameter(key, _SIZES[key], False))
            if hull[key] <= 0.0:
                raise InputError(place, f"is {hull[key]:g}", "give a positive number")
        else:
            numbers[key] = read_entry(key, entry, place, Parameter(key, coefficient_unit(key), False), "body", ties)
    return numbers, hull


def _read_effects(
    entries: Any, where: str, kinds: dict[str, type[AbstractEffect]], quantities: dict[str, str], ties: list[Tie]
) -> tuple[tuple[AbstractEffect, ...], tuple[Parameter, ...]]:
    """The `[[effects]]` of a file; `quantities` of its outputs are as `Facts` has them, and ties go into `ties`."""
    effects, rows = [], []
    if not isinstance(entries, list):
        raise InputError(f"{where}: effects", "is not a list of tables", "write [[effects]] above each effect")
    if len(entries) > _MOST_EFFECTS:
        raise InputError(f"{where}: effects", f"are {len(entries)}", f"give {_MOST_EFFECTS} at most")
    for number, entry in enumerate(entries, 1):
        table = Table(entry, where, f"effects[{number}]")
        kind = kinds[table.choice("effect", tuple(kinds))]
        chosen = {field.name.rstrip("_"): field for field in option_fields(kind)}
        table.only(("effect", "expression", "parameters", *chosen))
        place = f"{where}: effects[{number}]"
        named = {field.name: read_option(table, key, field) for key, field in chosen.items()}
        if any("of_output" in field.metadata for field in dataclasses.fields(kind)):
            named["quantity"] = quantity_of(named["channel"], quantities)
        try:
            effect = kind(**named)
        except InputError as error:  # options that do not go together; it does not know the file
            raise error.within(place) from error
        table_rows = _rows(effect, place)
        symbols = {symbol: field for field, symbol in effect.symbols().items()}
        given = table.table("parameters")
        given.only(tuple(symbols))
        values = {}
        for symbol, item in given.items():
            field = symbols[symbol]
            row, own = table_rows[field], f"{place}.parameters.{symbol}"
            values[field], table_rows[field] = read_entry(row.name, item, own, row, f"effects[{number}]", ties)
        effect = with_numbers(effect, values)
        if table.data.get("expression", effect.expression) != effect.expression:
            remedy = "delete the line; it says for a reader what the effect computes"
            raise InputError(f"{place}.expression", f"is not {effect.expression!r}", remedy)
        effects.append(effect)
        rows += list(table_rows.values())
    return tuple(effects), tuple(rows)


def _rows(effect: AbstractEffect, place: str) -> dict[str, Parameter]:
    try:
        return parameter_table(effect)
    except KeyError as error:  # the names and units of its numbers follow from its equation
        raise unknown_key(place, EQUATIONS, str(error.args[0])) from error
