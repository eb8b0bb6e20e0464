"""Results as valid JSON, which has neither NaN nor infinity."""

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any


def to_json(content: Any) -> str:
    """`content` as JSON text. Numbers that are not finite become `null`; arrays become lists; tuples too."""
    return json.dumps(plain(content), indent=1, allow_nan=False, ensure_ascii=False)


def plain(content: Any) -> Any:
    """`content` made of dictionaries, lists, texts, finite numbers, booleans and None."""
    if content is None or isinstance(content, bool | int | str):
        return content
    if isinstance(content, float):
        return content if math.isfinite(content) else None
    if isinstance(content, Mapping):
        return {str(key): plain(value) for key, value in content.items()}
    if isinstance(content, list | tuple | set | frozenset):
        return [plain(value) for value in content]
    if isinstance(content, PurePath):
        return str(content)
    if dataclasses.is_dataclass(content) and not isinstance(content, type):
        return plain({field.name: getattr(content, field.name) for field in dataclasses.fields(content)})
    arrays: Any = content  # of NumPy and JAX, and their scalars
    return plain(arrays.tolist())


def finite_text(value: float, form: str = ".3g") -> str:
    """`value` in a sentence, formatted by `form`; a number that is not finite in words."""
    if math.isnan(value):
        return "undefined"
    return format(value, form) if math.isfinite(value) else "beyond all bounds"
