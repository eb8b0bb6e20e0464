"""What the packages that read logs print about damage, kept off the terminal."""

import contextlib
import os
import tempfile
import threading
from collections.abc import Iterator
from typing import IO

from ...errors import InputError

# the streams are the process's: two threads would hand each other's back
_ONE_AT_A_TIME = threading.Lock()
_STDERR = 2
_SHOWN = 120  # characters of the first line


@contextlib.contextmanager
def printed() -> Iterator[list[str]]:
    """Once the block has ended, what a log's reader has printed, as the end of a sentence: one text, or none.

    What it prints, on standard output or error, goes nowhere else; an `InputError` of the block says it too.
    """
    texts: list[str] = []
    with _ONE_AT_A_TIME, tempfile.TemporaryFile("w+", errors="replace") as file:
        try:
            with _turned_away(file), contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
                yield texts
        except InputError as error:
            where, what, remedy = error.parts
            if not (said := _said(file)):
                raise
            raise type(error)(where, f"{what}; {said}", remedy) from error
        if said := _said(file):
            texts.append(said)


@contextlib.contextmanager
def _turned_away(file: IO[str]) -> Iterator[None]:
    """Standard error of compiled code, such as the index that pymavlink makes of a dataflash log, goes to `file`."""
    try:
        before = os.dup(_STDERR)
    except OSError:  # closed
        yield
        return
    try:
        os.dup2(file.fileno(), _STDERR)
        yield
    finally:
        os.dup2(before, _STDERR)
        os.close(before)


def _said(file: IO[str]) -> str:
    """What `file` holds, as the end of a sentence: the first line and a count, as each damaged byte may have a line."""
    file.seek(0)
    first = " ".join(file.readline().split())[:_SHOWN]
    more = sum(1 for _ in file)
    return f"its reader reports {first!r}{f' and {more} more lines' if more else ''}" if first else ""
