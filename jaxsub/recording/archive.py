"""Recordings in a zip archive: `runs.zip` that holds one file, or `runs.zip!dive.csv` for one of several."""

import os
import shutil
import tempfile
import zipfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from jaxsub.errors import InputError, nearest
from jaxsub.recording.bounds import require_plausible
from jaxsub.recording.reading import reading, require_file

MARK = "!"
_SUFFIX = ".zip"
_REMEDY = "give the path of an archive"


def split_member(path: Path) -> tuple[Path, str]:
    """The archive and the member that `runs.zip!dive.csv` stands for; the member is empty for any other path."""
    archive, mark, member = str(path).partition(_SUFFIX + MARK)
    return (Path(archive + _SUFFIX), member) if mark and not os.path.exists(path) else (path, "")


@contextmanager
def extracted(path: Path, member: str, suffixes: Collection[str]) -> Iterator[tuple[Path, str]]:
    """A member as a temporary file of the same suffix, and its name; of an archive with one recording this one.

    Raises InputError where there is none or, unless `member` names it, more than one with one of the `suffixes`.
    """
    require_file(path, _REMEDY)
    with tempfile.TemporaryDirectory(prefix="jaxsub-") as folder:
        with reading(str(path), "a zip archive"), zipfile.ZipFile(path) as archive:
            held = {info.filename: info for info in archive.infolist() if _is_recording(info, suffixes)}
            info = held[_choice(path, member, list(held))]
            where = f"{path}{MARK}{info.filename}"
            if info.flag_bits & 1:
                raise InputError(where, "is encrypted", "extract it, and give the file")
            require_plausible(where, info.file_size, info.compress_size)
            target = Path(folder) / f"member{PurePosixPath(info.filename).suffix.lower()}"
            with archive.open(info) as packed, target.open("wb") as file:
                shutil.copyfileobj(packed, file, 2**20)
        if not info.file_size:
            raise InputError(where, "is empty", "give a file with a header and a row for each sample")
        yield target, info.filename


def _choice(path: Path, member: str, names: list[str]) -> str:
    if member and member not in names:
        close = nearest(member, names)
        remedy = f"did you mean {close!r}?" if close else f"it holds {_listed(names)}"
        raise InputError(str(path), f"holds no recording {member!r}", remedy)
    if member:
        return member
    if not names:
        raise InputError(str(path), "holds no recording", "give an archive with a .csv file")
    if len(names) > 1:
        what = f"holds {len(names)} recordings: {_listed(names)}"
        raise InputError(str(path), what, f"name one of them: '{path}{MARK}{names[0]}'")
    return names[0]


def _is_recording(info: zipfile.ZipInfo, suffixes: Collection[str]) -> bool:
    name = PurePosixPath(info.filename)
    hidden = any(part.startswith((".", "__MACOSX")) for part in name.parts)
    return not info.is_dir() and not hidden and name.suffix.lower() in suffixes


def _listed(names: list[str]) -> str:
    return ", ".join(names[:10]) + (f" and {len(names) - 10} more" if len(names) > 10 else "")
