"""One file of arrays and a JSON text that refers to them: NumPy's `.npz`, which keeps no code and needs no pickle."""

import json
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError

# what reading a file that is none of ours may raise
_DAMAGED = (ValueError, KeyError, TypeError, AttributeError, EOFError, OSError, zipfile.BadZipFile, zlib.error)


def write_archive(path: Path, key: str, text: str, arrays: Mapping[str, np.ndarray]) -> None:
    """Write the JSON `text` under the name `key`, and `arrays` under theirs, to `path`."""
    content = {key: np.frombuffer(text.encode(), np.uint8), **arrays}
    # to a path NumPy would add a suffix
    with path.open("wb") as file:
        np.savez_compressed(file, **content)  # pyright: ignore[reportArgumentType]


@contextmanager
def opened_archive(path: Path, key: str, fault: str, remedy: str) -> Iterator[tuple[Any, Mapping[str, np.ndarray]]]:
    """What `write_archive` wrote to `path`: the content of its text, under `key`, and its arrays, read at their use.

    **Raises** `InputError` with the `remedy` where there is no file; with the `fault` too where it is damaged, or where
    what is done in the block finds it so.
    """
    if not path.is_file():
        raise InputError(str(path), "does not exist", remedy)
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            yield json.loads(bytes(arrays[key])), arrays
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(str(path), fault, remedy) from error
