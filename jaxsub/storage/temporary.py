"""Scratch folders: where a process writes what is to take a path's place, one process at a time for each path.

The folder `.jaxsub-KEY-PID-HOST` lies beside the path; KEY is a digest of the path's name. Its file `lock` is locked as
long as the process lives, so that the kernel tells a dead owner from a live one, also where numbers of processes are
used again or containers share a host's name.
"""

import contextlib
import hashlib
import os
import re
import shutil
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path

from ..errors import InputError

try:
    import fcntl
except ImportError:  # Windows has none: owners there count as alive while their number is in use
    fcntl = None

REPLACED = "replaced"
_LOCK = "lock"
_NAME = re.compile(r"\.jaxsub-(?P<key>[0-9a-f]{12})-(?P<pid>\d+)-(?P<host>[\w.-]+)")


# the scratch folders of this process, each with the parents that were made for it, the deepest first
_held: dict[Path, list[Path]] = {}


@contextlib.contextmanager
def scratch(out: Path) -> Iterator[Path]:
    """An empty folder beside `out`, held by this process and removed when the block ends.

    Parents that are missing are made, and removed again where nothing came to be in them. What dead processes of this
    host left in the same parent is removed first; a result that one of them had moved aside, and not yet replaced, is
    moved back.

    **Raises** `InputError` where another process holds `out`, and `OSError` where the parent cannot be written.
    """
    out = out.absolute()
    made = [path for path in out.parents if not path.exists()]
    try:
        for path in reversed(made):
            path.mkdir(exist_ok=True)
        folder = _folder(out)
        lock = _begun(folder, out)
        _held[folder] = made
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)
            _held.pop(folder, None)
    finally:
        _remove_empty(made)


def abandon() -> None:
    """Remove what this process holds, for one that ends at once: none of its blocks ends any more.

    Each folder is renamed first, so that what still runs can put nothing of it in place while it is removed.
    """
    for folder, made in list(_held.items()):
        gone = _folder(folder)
        with contextlib.suppress(OSError):
            folder.rename(gone)
            _clear(gone)
        _remove_empty(made)


def _folder(out: Path) -> Path:
    """The scratch folder of `out` and this process."""
    key = hashlib.sha256(out.name.encode(errors="surrogateescape")).hexdigest()[:12]
    return out.parent / f".jaxsub-{key}-{os.getpid()}-{_host()}"


def _begun(folder: Path, out: Path) -> int:
    """Make the scratch folder of `out`; the descriptor of its file `lock`, locked."""
    with locked(folder.parent):
        for other in scratch_folders(folder.parent):
            if not is_dead(other):
                _require_other_key(other, folder, out)
            else:
                _clear(other)
        folder.mkdir()
        try:
            lock = os.open(folder / _LOCK, os.O_RDWR | os.O_CREAT)
        except OSError:
            folder.rmdir()
            raise
        _lock(lock)
    return lock


def _remove_empty(folders: Sequence[Path]) -> None:
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()


def scratch_folders(parent: Path) -> list[Path]:
    """The scratch folders in `parent`."""
    found = [Path(entry.path) for entry in os.scandir(parent) if _NAME.fullmatch(entry.name)]
    return [path for path in found if path.is_dir() and not path.is_symlink()]


def clear_dead(parent: Path) -> None:
    """Remove what dead processes of this host left in `parent`."""
    for folder in scratch_folders(parent):
        if is_dead(folder):
            _clear(folder)


def is_dead(folder: Path) -> bool:
    """Whether the process that made a scratch folder is known to have ended."""
    named = _NAME.fullmatch(folder.name)
    if named is None or named["host"] != _host():
        return False
    try:
        lock = os.open(folder / _LOCK, os.O_RDWR)
    except OSError:
        return not _runs(int(named["pid"]))
    try:
        return _lock(lock) if fcntl else not _runs(int(named["pid"]))
    finally:
        os.close(lock)


def _require_other_key(other: Path, own: Path, out: Path) -> None:
    named, wanted = _NAME.fullmatch(other.name), _NAME.fullmatch(own.name)
    if named and wanted and named["key"] == wanted["key"]:
        remedy = f"wait for it or choose another --out; if it has ended, remove {other}"
        raise InputError(str(out), f"process {named['pid']} on {named['host']} is writing there", remedy)


def _clear(folder: Path) -> None:
    for path in (folder / REPLACED).glob("*"):
        back = folder.parent / path.name
        if not os.path.lexists(back):
            path.rename(back)
    shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def locked(parent: Path) -> Iterator[None]:
    """`parent` for this thread of this process alone, so that two that begin at once see each other."""
    if fcntl is None:
        yield
        return
    descriptor = os.open(parent, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):  # network folders that know no locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> bool:
    """Whether the file could be locked."""
    try:
        if fcntl is not None:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _host() -> str:
    return re.sub(r"[^\w.-]", "_", socket.gethostname())[:60] or "localhost"
