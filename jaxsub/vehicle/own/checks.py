"""Refusing a user's model that cannot be, with errors that say what of its class is at fault."""

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from ...arrays import Values
from ...errors import InputError, suggestion
from ..base import Layout
from .model import Model, numbers_of


def model_of(model: type[Model] | Model, values: Mapping[str, Values], where: str) -> Model:
    """A model of that class, or like that one, with the numbers `values`.

    **Raises** `InputError` for a number that it has not, and for one that is missing.
    """
    kind = model if isinstance(model, type) else type(model)
    fields = {field.name: field for field in numbers_of(kind)}
    for name in values:
        if name not in fields:
            hint = suggestion(name, fields, f"{kind.__name__} has {', '.join(fields) or 'none'}")
            raise InputError(f"{where}: coefficients.{name}", f"is no number of {kind.__name__}", hint)
    if isinstance(model, Model):
        return dataclasses.replace(model, **values)
    for name, field in fields.items():
        if name not in values and field.default is dataclasses.MISSING:
            raise InputError(f"{where}: coefficients.{name}", "is missing", f"add {name} = …")
    return kind(**values)


def channels_of(model: type[Model] | Model, where: str) -> tuple[str, ...]:
    """The channels of a model: its states, and what it shows beside them.

    **Raises** `InputError` for a class without names of states, and for what it shows that is not by name.
    """
    kind = model if isinstance(model, type) else type(model)
    for key, least in (("states", 1), ("inputs", 0)):
        names: Any = getattr(kind, key, ())
        words = isinstance(names, tuple) and all(isinstance(n, str) and re.fullmatch(r"[A-Za-z]\w*", n) for n in names)
        if not words or len(set(names)) < len(names) or len(names) < least:
            raise InputError(
                f"{where}: class", f"has {key} = {names!r:.60}", f'write {key} = ("name",) in {kind.__name__}'
            )
    blank = _with_blanks(model)
    shown = _called(blank, "shown", where)
    return (*kind.states, *shown)


def check_model(model: Model, layout: Layout, where: str) -> None:
    """Refuse a model that has other inputs than the file, or not one rate for each state."""
    given = tuple(name for name, _ in layout.inputs)
    for name in (*given, *model.inputs):
        if name not in model.inputs or name not in given:
            what = "is no input of" if name not in model.inputs else "is missing for"
            raise InputError(
                f"{where}: inputs.{name}",
                f"{what} {type(model).__name__}",
                f"it has {', '.join(model.inputs) or 'none'}",
            )
    rates = _called(model, "rates", where)
    if set(rates) != set(model.states):
        what = f"gives rates of {', '.join(rates) or 'nothing'}"
        raise InputError(f"{where}: class", what, f"give one of each state: {', '.join(model.states)}")


def _with_blanks(model: type[Model] | Model) -> Model:
    """The model itself, or one of the class with zeros for numbers."""
    if isinstance(model, Model):
        return model
    return model(**{field.name: np.zeros(()) for field in numbers_of(model)})


def _called(model: Model, method: str, where: str) -> dict[str, Any]:
    """The shapes of what a method of the model gives, by name, at zero."""
    blank = np.zeros(())
    states, inputs = dict.fromkeys(model.states, blank), dict.fromkeys(model.inputs, blank)
    try:
        found = jax.eval_shape(getattr(model, method), states, inputs, blank)
    except Exception as error:
        what = f"{type(model).__name__}.{method} fails: {error!r:.200}"
        raise InputError(f"{where}: class", what, "mend it; state and inputs are dictionaries by name") from error
    if not isinstance(found, dict) or not all(getattr(part, "shape", None) == () for part in found.values()):
        what = f"{type(model).__name__}.{method} gives no dictionary of numbers"
        raise InputError(f"{where}: class", what, 'return {"name": rate}, of the shape of the states')
    return found
