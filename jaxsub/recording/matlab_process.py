"""MATLAB files are read in another process, since some damaged ones end the process that SciPy reads in."""

import atexit
import json
import os
import pickle
import struct
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

from . import matlab_server

_LOCK = threading.Lock()


class _Server:
    """The process that reads for this one: it imports SciPy once, and reads each file in a copy of itself."""

    process: subprocess.Popen | None = None
    owner: int | None = None


def read_variables(path: Path, room: int) -> dict[str, Any]:
    """The file's variables by name. Reading may take `room` bytes.

    **Raises** ValueError with what the reader said where it fails.
    """
    with _LOCK:
        succeeded, content = _answer(_server(), [str(path.absolute()), room])
    if not succeeded:
        raise ValueError(content.decode(errors="replace"))
    return pickle.loads(content)


def _server() -> subprocess.Popen:
    """The process that reads; a new one where there is none, or it is that of a process that this is a copy of."""
    process = _Server.process
    if process is None or process.poll() is not None or _Server.owner != os.getpid():
        # -P: modules that lie in the folder where the user stands are none of ours
        command = [sys.executable, "-P", matlab_server.__file__]
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        _Server.process, _Server.owner = process, os.getpid()
        atexit.register(_end, process, os.getpid())
    return process


def _answer(process: subprocess.Popen, request: list) -> tuple[bool, bytes]:
    stdin, stdout = process.stdin, process.stdout
    assert stdin is not None and stdout is not None  # both are pipes
    try:
        stdin.write(json.dumps(request).encode() + b"\n")
        stdin.flush()
        succeeded, size = matlab_server.ANSWER.unpack(stdout.read(matlab_server.ANSWER.size))
        return succeeded, stdout.read(size)
    except (OSError, struct.error):
        return False, b"the reader of MATLAB files breaks off"
    except BaseException:
        _end(process, os.getpid())  # half an answer is left in the pipe
        raise


def _end(process: subprocess.Popen, owner: int) -> None:
    """End the process with the one that it reads for."""
    if owner == os.getpid():
        process.kill()
        process.wait()
