"""What to take of a log: which channel becomes which column, and from when to when."""

import dataclasses
import math
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...errors import InputError, nearest
from .arithmetic import Term, parse_term

_SPAN = ("every", "start", "end")


@dataclasses.dataclass(frozen=True)
class Selection:
    """Columns of a recording by the channels of a log that they come from.

    **Fields**

    - `columns`: what each column is, under a header `name[unit]` whose unit is the result's; without one it is the
      unit that the log states, else SI. Written as a channel, scaled and shifted at will: `-channel`, `0.35 * channel`,
      `(channel - 1500) * 0.001`, `90 - channel`, with blanks around `+`, `-` and `/`. In place of a channel
      `unwrap(channel)` is an angle without jumps of a turn, and `roll(q)`, `pitch(q)`, `yaw(q)` are the Euler angles
      (yaw, pitch, roll in that order, rad) of the quaternion `q[0]` to `q[3]` (scalar first) or `q.x`, `q.y`, `q.z`,
      `q.w`.
    - `every`: distance of the rows, s, else there is one for each sample.
    - `start`, `end`: what to cut out, s from the first sample of the channels taken.

    Raises InputError for a column that cannot be understood, and for numbers that are not finite or positive.
    """

    columns: Mapping[str, str]
    every: float | None = None
    start: float | None = None
    end: float | None = None
    source: str = "columns"

    def __post_init__(self):
        if not self.columns:
            raise InputError(self.source, "names no column", "write [columns] with lines like r = 'topic.field'")
        for header in self.columns:
            self.term(header)
        for name in _SPAN:
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and (name != "every" or value > 0.0)):
                raise InputError(f"{self.source}, {name}", f"{value!r} will not do", "give a number of seconds")

    def term(self, header: str) -> Term:
        """What the column under `header` is."""
        text = self.columns[header]
        try:
            return parse_term(text)
        except ValueError as error:
            remedy = "write it like 'topic.field', '-roll(q)' or '(x - 1500) * 0.001'"
            raise InputError(f"{self.source}, column {header!r}", f"{text!r:.60} {error}", remedy) from error


def read_selection(path: str | os.PathLike[str]) -> Selection:
    """Read the TOML file `path` with a table `[columns]` and, before it, perhaps `every`, `start` and `end`.

    Raises InputError, naming the file and the key, for whatever else the file holds.
    """
    try:
        data: dict[str, Any] = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "give the path of a TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"is not TOML ({error})", "quote headers with brackets: 'r[deg/s]'") from error
    known = ("columns", *_SPAN)
    for key in data:
        if key not in known:
            remedy = f"did you mean {close!r}?" if (close := nearest(key, known)) else f"use {', '.join(known)}"
            raise InputError(str(path), f"unknown key {key!r}", remedy)
    columns = data.get("columns", {})
    if not isinstance(columns, dict) or not all(isinstance(text, str) for text in columns.values()):
        raise InputError(
            f"{path}, columns", "is no table of texts", "write [columns] with lines like r = 'topic.field'"
        )
    every, start, end = (_seconds(f"{path}, {key}", data.get(key)) for key in _SPAN)
    return Selection(columns, every, start, end, str(path))


def _seconds(where: str, value: Any) -> float | None:
    if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
        return None if value is None else float(value)
    raise InputError(where, f"{value!r} is no number", "give a number of seconds")
