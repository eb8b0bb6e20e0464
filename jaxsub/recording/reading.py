"""What all readers share: the check of a path, and the error of a damaged file."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from jaxsub.errors import InputError
from jaxsub.findings import Finding
from jaxsub.recording.frames import Table
from jaxsub.recording.recording import FIRST_ROW

_KINDS = (
    (stat.S_ISDIR, "is a folder"),
    (stat.S_ISFIFO, "is a named pipe"),
    (stat.S_ISSOCK, "is a socket"),
    (stat.S_ISCHR, "is a device"),
    (stat.S_ISBLK, "is a device"),
)


class Contents(NamedTuple):
    """What a file holds: its columns as read, how they were read, and the row of the first sample."""

    table: Table
    findings: tuple[Finding, ...] = ()
    first_row: int = FIRST_ROW


def note(source: str, check: str, what: str, channel: str = "", count: int = 0) -> Finding:
    """A finding that says how `source` was read."""
    return Finding(check, "note", source, what, channel=channel, count=count)


def require_file(path: Path, remedy: str = "give the path of a recording") -> int:
    """The size of the file at `path`, bytes. Raises InputError for what is no file, or is empty."""
    shown = str(path).replace("\0", "\\0")
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(shown, "no such file", remedy) from error
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise InputError(shown, f"is no path ({getattr(error, 'strerror', None) or error})", remedy) from error
    for is_kind, what in _KINDS:
        if is_kind(status.st_mode):
            raise InputError(shown, what, remedy)
    if not status.st_size:
        raise InputError(shown, "is empty", "check that it was written to the end")
    return status.st_size


@contextmanager
def reading(source: str, form: str) -> Iterator[None]:
    """Raise InputError, naming `source`, for whatever is raised within; `form` is what it should be."""
    try:
        yield
    except InputError:
        raise
    except MemoryError as error:
        raise InputError(source, "does not fit into memory", "divide the file, or leave columns out") from error
    except Exception as error:  # no library promises what it raises on a damaged file
        said = str(error).replace("\0", "\\0")[:300] or type(error).__name__
        raise InputError(source, f"cannot be read ({said})", f"check that it is whole and is {form}") from error
