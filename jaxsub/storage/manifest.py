"""Manifests: which files jaxsub wrote, so that it replaces no other.

A manifest is text of one JSON object a line. The first is `{"schema": 1, "jaxsub": VERSION, "command": COMMAND}`; each
other is `{"file": PATH, "size": BYTES, "sha256": DIGEST}` or `{"folder": PATH}`, with paths relative to the manifest's
folder and `/` between their parts. A file is listed before it is in place, so one file may have several lines: it is
jaxsub's where its content is that of one of them. A last line that a crash cut off counts for nothing.

A folder of results holds its manifest as `.jaxsub.jsonl`; a single file NAME has it beside itself as
`.NAME.jaxsub.jsonl`.
"""

import dataclasses
import hashlib
import json
import os
from importlib import metadata
from pathlib import Path
from typing import Any

from ..errors import InputError
from .temporary import is_dead, locked, scratch_folders

MANIFEST = ".jaxsub.jsonl"
_SCHEMA = 1


@dataclasses.dataclass(frozen=True)
class Manifest:
    """The manifest file at `path`, about the files in `path.parent`."""

    path: Path

    @classmethod
    def of_folder(cls, folder: Path) -> "Manifest":
        """That of a folder of results."""
        return cls(folder / MANIFEST)

    @classmethod
    def of_file(cls, file: Path) -> "Manifest":
        """The manifest of the single result `file`."""
        return cls(file.with_name(f".{file.name}{MANIFEST}"))

    def begin(self, command: str) -> None:
        """Write the first line, which names the `command`, unless there is one."""
        with locked(self.path.parent):
            if self._lines():
                return
            self._append({"schema": _SCHEMA, "jaxsub": installed_version("jaxsub"), "command": command})

    def add(self, file: Path, content: Path | None = None) -> None:
        """List `file` with what it holds, or with what is at `content` and will be moved there."""
        line = {
            "file": file.relative_to(self.path.parent).as_posix(),
            **size_and_digest(file if content is None else content),
        }
        with locked(self.path.parent):
            self._append(line)

    def add_all(self) -> None:
        """List every file and folder beside the manifest and below."""
        root = self.path.parent
        for path in sorted(root.rglob("*")):
            if path.is_dir():
                with locked(root):
                    self._append({"folder": path.relative_to(root).as_posix()})
            elif path != self.path:
                self.add(path)

    def lists(self, file: Path) -> bool:
        """Whether `file` is a regular file with a content that the manifest lists."""
        known = [line for line in self._lines() if line.get("file") == file.relative_to(self.path.parent).as_posix()]
        if file.is_symlink() or not file.is_file():
            return False
        size = file.stat().st_size
        sized = [line for line in known if line.get("size") == size]
        return bool(sized) and size_and_digest(file)["sha256"] in [line.get("sha256") for line in sized]

    def exists(self) -> bool:
        """Whether there is a manifest."""
        return bool(self._lines())

    def foreign(self) -> Path | None:
        """The first file or folder beside the manifest, or below, that it does not list as it is; None where all are.

        Scratch folders of dead processes do not count.
        """
        root, lines = self.path.parent, self._lines()
        folders = {line["folder"] for line in lines if "folder" in line}
        folders |= {p.as_posix() for line in lines if "file" in line for p in Path(line["file"]).parents}
        for here, below, files in os.walk(root, onerror=_raise):
            dead = {path.name for path in scratch_folders(Path(here)) if is_dead(path)}
            below[:] = sorted(set(below) - dead)
            for name in below:
                path = Path(here, name)
                if path.is_symlink() or path.relative_to(root).as_posix() not in folders:
                    return path
            for name in sorted(files):
                path = Path(here, name)
                if path != self.path and not self.lists(path):
                    return path
        return None

    def _lines(self) -> list[dict[str, Any]]:
        """The lines, none where the file is no manifest."""
        if self.path.is_symlink() or not self.path.is_file():
            return []
        lines = []
        for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                lines.append(json.loads(line))
            except ValueError:
                continue
        lines = [line for line in lines if isinstance(line, dict)]
        return lines if lines and "jaxsub" in lines[0] and lines[0].get("schema") == _SCHEMA else []

    def _append(self, line: dict[str, Any]) -> None:
        """Write a line, in a folder that is `locked`."""
        # begins with a line break, so that one that a crash cut off does not spoil this one
        with self.path.open("a", encoding="utf-8") as file:
            file.write(f"\n{json.dumps(line)}" if file.tell() else json.dumps(line))
            file.flush()
            os.fsync(file.fileno())


def require_ours(out: Path, overwrite: str, remedy: str) -> None:
    """Raise `InputError` unless all that is at `out` was written by jaxsub and is as it was written.

    `overwrite` is the option that would replace it, and `remedy` what the error says to do.
    """
    manifest = Manifest.of_folder(out) if out.is_dir() else Manifest.of_file(out)
    if not manifest.exists():
        what = f"was not written by jaxsub: there is no manifest {manifest.path}"
        raise InputError(str(out), f"{what}, and {overwrite} replaces nothing else", remedy)
    other = manifest.foreign() if out.is_dir() else None if manifest.lists(out) else out
    if other is not None:
        what = f"was not written by jaxsub or has changed since, and {overwrite} replaces nothing else"
        raise InputError(str(other), what, remedy)


def installed_version(package: str) -> str:
    """The version of an installed package."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:  # a checkout that nobody installed
        return "not installed"


def size_and_digest(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of the file at `path`, by which it is known again."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        return {"size": os.fstat(file.fileno()).st_size, "sha256": digest}


def _raise(error: OSError) -> None:
    raise error
