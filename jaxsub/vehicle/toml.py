"""TOML files in, within bounds: whatever a path leads to is read in a moment or refused in one line."""

import stat
import tomllib
from pathlib import Path
from typing import Any

from ..errors import InputError

_LARGEST = 4_000_000  # bytes; a vehicle file of every effect has some thousands
_DEEPEST = 20  # tables and lists within each other; a vehicle file has five
_LONGEST = 1000  # characters of a key or a text


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of the file at `path`.

    **Raises** `InputError` for what is no file, too large, no UTF-8 or no TOML.
    """
    try:
        found = path.stat()
        # a FIFO or a device could be waited on for ever
        if not stat.S_ISREG(found.st_mode):
            what = "is a folder" if path.is_dir() else "is no file"
            raise InputError(str(path), what, "give the path of a vehicle file")
        if found.st_size > _LARGEST:
            what = f"has {found.st_size / 1e6:.0f} MB, more than {_LARGEST / 1e6:.0f}"
            raise InputError(str(path), what, "give a vehicle file; a recording comes after it")
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "give the path of a vehicle file") from error
    except UnicodeDecodeError as error:
        raise InputError(str(path), "is not text", "give a vehicle file in TOML, encoded as UTF-8") from error
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        if "\0" in str(path):
            name = str(path).replace("\0", "\\0")
            raise InputError(name, "is no path", "give the path of a vehicle file") from error
        # a number of 5000 digits and 5000 brackets are no TOMLDecodeError
        named = path.suffix.lower() == ".toml"
        remedy = "mend it at that place" if named else "give the vehicle's .toml file first, then the runs"
        raise InputError(str(path), f"is not TOML: {error}", remedy) from error


def check_tree(data: Any, where: str) -> None:
    """Refuse keys and texts that no file needs: longer than 1000 characters, with control characters, nested deeply."""
    left = [(data, "", 0)]
    while left:
        item, place, depth = left.pop()
        at = f"{where}: {place}" if place else where
        if depth > _DEEPEST:
            raise InputError(f"{where}: {place:.60}", f"is nested more than {_DEEPEST} deep", "write it flat")
        if isinstance(item, str):
            _check_text(item, at)
        elif isinstance(item, dict):
            for key, below in item.items():
                _check_text(str(key), at)
                left.append((below, f"{place}.{key}" if place else str(key), depth + 1))
        elif isinstance(item, list):
            left += [(below, place, depth + 1) for below in item]


def _check_text(text: str, at: str) -> None:
    if len(text) > _LONGEST:
        raise InputError(at, f"has a text of {len(text)} characters", f"write {_LONGEST} at most")
    if not text.isprintable():
        raise InputError(at, f"{text!r:.60} has a character that cannot be printed", "delete it")
