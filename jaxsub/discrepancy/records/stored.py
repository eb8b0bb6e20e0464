"""Conclusions on disk, to draw a report again: `diagnosis.npz`, arrays and a JSON text that refers to them.

The text is `{"schema": 1, "conclusions": {...}}` by the names of the fields. An array in it is the number of one of the
file's arrays. Numbers are exact; arrays are in single precision but for times.
"""

import dataclasses
import json
import types
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...arrays import single
from ...errors import InputError
from ...storage import opened_archive, write_archive
from .diagnosis import Conclusions

STORED = "diagnosis.npz"
_SCHEMA, _TEXT = 1, "conclusions"


def save_conclusions(conclusions: Conclusions, path: Path) -> None:
    """Write all but the vehicles that explain the recordings about as well."""
    arrays: list[np.ndarray] = []
    encoded = _encoded(dataclasses.replace(conclusions, explanations=()), arrays)
    text = json.dumps({"schema": _SCHEMA, _TEXT: encoded})
    named = {f"array_{index}": array for index, array in enumerate(arrays)}
    write_archive(path, _TEXT, text, named)


def load_conclusions(path: Path) -> Conclusions:
    """What `save_conclusions` wrote.

    **Raises** `InputError` where the file is absent, damaged, or of another version.
    """
    remedy = "give the folder of a diagnosis by this version of jaxsub, or run `jaxsub diagnose` again"
    with opened_archive(path, _TEXT, "cannot be read as a diagnosis", remedy) as (content, arrays):
        if content["schema"] != _SCHEMA:
            raise InputError(str(path), f"has schema {content['schema']} and not {_SCHEMA}", remedy)
        return _decoded(Conclusions, content[_TEXT], arrays)


def _encoded(value: Any, arrays: list[np.ndarray], name: str = "") -> Any:
    """`value` as JSON has it, its arrays appended to `arrays`; `name` is that of the field it is in."""
    if isinstance(value, np.ndarray):
        arrays.append(value.astype(np.float64) if name == "times" else single(value))
        return len(arrays) - 1
    if dataclasses.is_dataclass(value):
        return {
            field.name: _encoded(getattr(value, field.name), arrays, field.name) for field in dataclasses.fields(value)
        }
    if isinstance(value, Mapping):
        return {key: _encoded(one, arrays) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_encoded(one, arrays) for one in value]
    return value.item() if isinstance(value, np.generic) else value


def _decoded(kind: Any, value: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """What `_encoded` made JSON of, by its type `kind`."""
    origin, of = typing.get_origin(kind), typing.get_args(kind)
    if value is None:
        return None
    if kind is np.ndarray:
        return arrays[f"array_{int(value)}"].astype(float)
    if dataclasses.is_dataclass(kind):
        hints = typing.get_type_hints(kind)
        return kind(**{name: _decoded(hints[name], one, arrays) for name, one in value.items()})  # pyright: ignore[reportCallIssue]
    if origin in (types.UnionType, typing.Union):
        return _decoded(next(one for one in of if one is not type(None)), value, arrays)
    if origin is dict:
        return {key: _decoded(of[1], one, arrays) for key, one in value.items()}
    if origin is tuple and of[-1] is not Ellipsis:
        return tuple(_decoded(own, one, arrays) for own, one in zip(of, value, strict=True))
    if origin in (list, tuple, Sequence):
        items = [_decoded(of[0], one, arrays) for one in value]
        return tuple(items) if origin is tuple else items
    return float(value) if kind is float else value
