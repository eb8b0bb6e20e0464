"""Results of commands: they appear whole or not at all, and replace only what jaxsub wrote."""

import errno
import itertools
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

import click

from ..errors import InputError, OutputError
from ..storage import Manifest, place, require_ours, scratch
from ..storage.whole import flush
from .options import options
from .run_log import RunLog

# a folder for the next of a command's results
Fresh = Callable[[], AbstractContextManager[Path]]

_ANOTHER = "choose another --out"
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO, errno.ENAMETOOLONG)


def paths_of(*given: Path | None) -> list[Path]:
    """The paths among arguments of which some may be absent."""
    return [path for path in given if path is not None]


def require_replaceable(out: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> None:
    """Raise `InputError` unless a command may write to `out`.

    Refused are a link, an input of the command, a folder that holds one or the current folder, whatever exists without
    `overwrite`, with it whatever a manifest does not list as it is (`storage.manifest`), and a folder that cannot be
    written.
    """
    try:
        require_apart(out, inputs)
        if os.path.lexists(out):
            if not overwrite:
                raise InputError(str(out), "already exists", f"{_ANOTHER} or add --overwrite")
            require_ours(out, "--overwrite", f"{_ANOTHER} or remove it yourself")
        parent = next(path for path in out.absolute().parents if os.path.lexists(path))
        if not parent.is_dir():
            raise InputError(str(out), f"{parent} is not a folder", _ANOTHER)
        if not os.access(parent, os.W_OK | os.X_OK):
            raise InputError(str(out), f"{parent} cannot be written", _ANOTHER)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(str(out).replace("\0", "\\0"), f"cannot be used ({_reason(error)})", _ANOTHER) from error


def require_apart(out: Path, inputs: Sequence[Path]) -> None:
    """Raise `InputError` for a link, an input, or a folder that holds an input or the current folder."""
    if out.is_symlink():
        raise InputError(str(out), "is a link", "give --out the path that it leads to, or another")
    at = _real(out)
    for path in inputs:
        if out.exists() and path.exists() and out.samefile(path):
            raise InputError(str(out), f"is the input {path}", _ANOTHER)
        if at in (_real(path), path.absolute()):
            raise InputError(str(out), f"is the input {path}", _ANOTHER)
        if at in (*_real(path).parents, *path.absolute().parents):
            raise InputError(str(out), f"holds the input {path}", _ANOTHER)
    here = Path.cwd()
    if at == here or at in here.parents:
        raise InputError(str(out), "is the current folder or holds it", _ANOTHER)


def _real(path: Path) -> Path:
    """The path without links, as far as they lead; `Path.resolve` raises where they lead in a circle before 3.13."""
    return Path(os.path.realpath(path))


@contextmanager
def fresh_folder(out: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> Iterator[Path]:
    """A folder to write results to, which takes the place of `out` when the block ends well and vanishes otherwise.

    It gets `run.json`, which says what it was made by, and the manifest of what was written. `inputs` are the files
    that the command reads.

    **Raises** `InputError` where `out` may not be replaced (`require_replaceable`), where another process writes there
    and where nothing can be written there; `OutputError` where writing fails later.
    """
    with fresh_folders(out, overwrite, inputs) as fresh, fresh() as new:
        yield new


@contextmanager
def fresh_folders(out: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> Iterator[Fresh]:
    """As `fresh_folder`, for results that come one after the other: each call gives a folder for the next.

    Each takes the place of the one before, so that what ends the command later leaves the last one at `out`.
    """
    require_replaceable(out, overwrite, inputs)
    log = RunLog(inputs)
    with claimed(out) as folder:
        number = itertools.count()

        @contextmanager
        def fresh() -> Iterator[Path]:
            index = next(number)
            new = folder / f"new-{index}" / _real(out).name
            new.mkdir(parents=True)
            with _told_of(new, out):
                yield new
                log.write(new)
                manifest = Manifest.of_folder(new)
                manifest.begin(_command())
                manifest.add_all()
                _put(new, out, folder, overwrite or index > 0)

        yield fresh


@contextmanager
def fresh_file(out: Path, overwrite: bool, inputs: Sequence[Path] = ()) -> Iterator[Path]:
    """A path to write one file to, which takes the place of `out` when the block ends well; as `fresh_folder`.

    Its manifest is the file `.NAME.jaxsub.jsonl` beside it.
    """
    if out.is_dir() and not out.is_symlink():
        raise InputError(str(out), "is a folder", "give --out a file")
    manifest = Manifest.of_file(out)
    require_replaceable(out, overwrite, inputs)
    with claimed(out) as folder:
        new = folder / out.name
        with _told_of(new, out):
            yield new
            flush(new)
            manifest.begin(_command())
            manifest.add(out, new)
            _put(new, out, folder, overwrite)


@contextmanager
def redrawn(folder: Path) -> Iterator[Path]:
    """A folder to write files to, which take the places of those of the same name in `folder` once the block ends well.

    All else in `folder` stays. **Raises** `InputError` where jaxsub did not write one that would be replaced, or it has
    changed since, and where another process writes there; `OutputError` where writing fails.
    """
    manifest = Manifest.of_folder(folder)
    with claimed(folder) as space:
        new = space / "new"
        new.mkdir()
        with _told_of(new, folder):
            yield new
            placed = {path: folder / path.relative_to(new) for path in sorted(new.rglob("*")) if path.is_file()}
            for there in placed.values():
                if os.path.lexists(there) and not manifest.lists(there):
                    what = "was not written by jaxsub or has changed since"
                    raise InputError(str(there), what, "move it away and run again")
            manifest.begin(_command())
            for path, there in placed.items():
                flush(path)
                manifest.add(there, path)
                there.parent.mkdir(exist_ok=True)
                os.replace(path, there)
    options().kept = f"{folder} is complete"


@contextmanager
def claimed(out: Path) -> Iterator[Path]:
    """A scratch folder beside `out`, which no other process may write while the block runs (`storage.scratch`).

    **Raises** `InputError` where another process writes there, and where nothing can be written.
    """
    with ExitStack() as ending:
        try:
            folder = ending.enter_context(scratch(out))
        except OSError as error:
            raise InputError(str(out), f"cannot be written ({_reason(error)})", _ANOTHER) from error
        yield folder


@contextmanager
def _told_of(new: Path, out: Path) -> Iterator[None]:
    """Failures to write `new` as an `OutputError`, and errors about `new` as such about `out`."""
    try:
        yield
    except InputError as error:
        where, what, remedy = error.parts
        if str(new) not in where:
            raise
        raise type(error)(where.replace(str(new), str(out)), what, remedy) from error
    except OSError as error:
        written = str(error.filename or "")
        if error.errno not in _UNWRITABLE and not written.startswith(str(new)):
            raise
        where = written.replace(str(new), str(out)) if written.startswith(str(new)) else str(out)
        raise OutputError(where, f"cannot be written ({_reason(error)})", f"make room there or {_ANOTHER}") from error


def _put(new: Path, out: Path, folder: Path, overwrite: bool) -> None:
    """Move `new` to `out`, or beside it where `out` has become something that may not be replaced."""
    try:
        require_replaceable(out, overwrite)
    except InputError as error:
        other = next(path for i in range(1, 10**6) if not os.path.lexists(path := out.with_name(f"{out.name}-{i}")))
        new.rename(other)
        where, what, _ = error.parts
        raise OutputError(
            where, f"{what}; it came there or changed meanwhile", f"the results are in {other}"
        ) from error
    place(new, out, folder)
    options().kept = f"{out} is complete"


def _command() -> str:
    context = click.get_current_context(silent=True)
    return context.info_name or "" if context else ""


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)
