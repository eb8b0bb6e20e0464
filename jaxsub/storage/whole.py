"""Files and folders put in place by one rename."""

import ctypes
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .temporary import REPLACED, scratch

_HERE, _EXCHANGE = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of Linux


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A path to write a file to, which takes the place of the file at `path` when the block ends well.

    **Raises** `InputError` where another process writes to `path`, and `OSError` where it cannot be written, as in a
    folder that does not exist.
    """
    path.parent.stat()
    with scratch(path) as folder:
        beside = folder / path.name
        yield beside
        flush(beside)
        os.replace(beside, path)


def place(new: Path, out: Path, folder: Path) -> None:
    """Move `new`, which lies in the scratch folder `folder`, to `out`, and what is there to `new`'s place.

    **Raises** `OSError` where something is at `out` and cannot be moved.
    """
    if not os.path.lexists(out):
        new.rename(out)
    elif not exchange(new, out):
        # two renames; whoever finds the scratch folder of a process that died between them moves the old one back
        aside = folder / REPLACED
        aside.mkdir()
        out.rename(aside / out.name)
        new.rename(out)
        shutil.rmtree(aside, ignore_errors=True)


def exchange(one: Path, other: Path) -> bool:
    """Swap the paths `one` and `other` in one step; False where the system cannot."""
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None) if os.name == "posix" else None
    return rename is not None and rename(_HERE, os.fsencode(one), _HERE, os.fsencode(other), _EXCHANGE) == 0


def flush(path: Path) -> None:
    """Have the disk hold what `path` holds."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
