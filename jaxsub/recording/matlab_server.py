"""A program that reads MATLAB files, one a request, so that what a damaged file does to SciPy stays with that file.

It is run by itself, by `matlab_process`, and imports nothing of jaxsub. A request is a line of JSON: the path, and how
many bytes the reading may take beside what the program itself takes. The answer is 0 or 1, the number of bytes that
follow, and those: a pickle of the variables, or what went wrong, in one line.
"""

import json
import os
import pickle
import struct
import sys
import traceback
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

ANSWER = struct.Struct("<?Q")


def main() -> None:
    """Answer requests until there are no more."""
    # warnings are about classes that it cannot read; they are refused when they are used
    warnings.simplefilter("ignore")
    import pymatreader

    for line in sys.stdin:
        path, room = json.loads(line)
        succeeded, content = _apart(partial(_read, pymatreader.read_mat, path, room))
        sys.stdout.buffer.write(ANSWER.pack(succeeded, len(content)) + content)
        sys.stdout.buffer.flush()
        if not hasattr(os, "fork"):
            return  # a file may have damaged this process, which cannot be seen from outside: the next has another


def _read(read: Callable[[str], dict], path: str, room: int) -> tuple[bool, bytes]:
    """Whether `read` reads the file, and its variables or what went wrong, as bytes."""
    _limit(room)
    try:
        return True, pickle.dumps(read(path), protocol=5)
    except Exception as error:
        return False, traceback.format_exception_only(error)[-1].strip().splitlines()[-1].encode()


def _limit(room: int) -> None:
    """Take no more than `room` bytes from here on, where the system says what is taken.

    SciPy makes room for a cell array of any size that is claimed.
    """
    used = Path("/proc/self/statm")
    if used.exists():
        import resource

        most = int(used.read_text().split()[0]) * resource.getpagesize() + room
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _apart(read: Callable[[], tuple[bool, bytes]]) -> tuple[bool, bytes]:
    """What `read` returns, in a copy of this process, where the system makes copies."""
    if not hasattr(os, "fork"):
        return read()
    result, to_parent = os.pipe()
    child = os.fork()
    if not child:
        try:
            succeeded, content = read()
            with open(to_parent, "wb") as pipe:
                pipe.write(bytes([succeeded]) + content)
        finally:
            os._exit(0)
    os.close(to_parent)
    with open(result, "rb") as pipe:
        found = pipe.read()
    _, status = os.waitpid(child, 0)
    return (bool(found[0]), found[1:]) if status == 0 and found else (False, b"the reader of MATLAB files breaks off")


if __name__ == "__main__":
    main()
