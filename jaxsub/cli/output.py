"""Results appear whole or not at all."""

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError


def refuse_existing(out: Path, overwrite: bool) -> None:
    """Raise `InputError` where `out` exists and may not be replaced, or its parent cannot hold it."""
    if out.exists() and not overwrite:
        raise InputError(str(out), "already exists", "choose another --out or add --overwrite")
    parent = out.resolve().parent
    if parent.exists() and not parent.is_dir():
        raise InputError(str(out), f"{parent} is not a folder", "choose another --out")


@contextmanager
def fresh_folder(out: Path, overwrite: bool) -> Iterator[Path]:
    """A temporary folder beside `out` that takes its place when the block ends well, and vanishes when it does not."""
    refuse_existing(out, overwrite)
    parent = out.resolve().parent
    parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=parent, prefix=".jaxsub-") as scratch:
        folder = Path(scratch) / out.name
        folder.mkdir()
        yield folder
        if out.exists():
            out.rename(Path(scratch) / "replaced")
        shutil.move(folder, out)
