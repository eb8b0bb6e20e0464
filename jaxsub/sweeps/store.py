"""The folder that a sweep is kept in: `plan.json`, and a NetCDF file for each chunk that is done.

A file is written beside its place and moved there once it is whole, so what is there is done, whenever the sweep was
interrupted. A file that cannot be read, as after a failure of the disk, counts as missing. The manifest
(`storage.manifest`) lists what was written. Each chunk names its plan and holds the layout, so that a damaged
`plan.json` is made anew from them by the command that began the sweep.
"""

import dataclasses
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from ..errors import InputError, OutputError
from ..storage import Manifest, clear_dead, written_whole
from .description import described, difference, layout, name_of
from .plan import Chunk, Plan
from .run import Answers

PLAN, CELLS = "plan.json", "cells"
_ENGINE, _UNREADABLE = "h5netcdf", (OSError, KeyError, ValueError)


@dataclasses.dataclass(frozen=True)
class Store:
    """A sweep's folder, of the plan named `name`, laid out as the JSON text `layout` says."""

    folder: Path
    name: str
    layout: str = ""

    @classmethod
    def of(cls, folder: Path, plan: Plan) -> tuple["Store", Plan]:
        """The store of `plan` in `folder`, begun or found there, and the plan with what was settled when it was begun.

        **Raises** `InputError`, and leaves the folder as it is, where that holds another plan or something else.
        """
        kept, wanted = check_folder(folder, plan), described(plan)
        if kept is None:
            plan = plan.settled()
            kept = {"plan": wanted, "layout": layout(plan)}
        shape = kept["layout"]
        store = cls(folder, name_of(wanted), json.dumps(shape))
        if not _readable(folder):
            store.keep(folder / PLAN, json.dumps(kept, indent=1).encode())
        return store, dataclasses.replace(plan, sigma=shape["sigma"], width=shape["width"])

    def missing(self, chunks: Iterable[Chunk]) -> list[Chunk]:
        """Those of the chunks that are not done."""
        return [chunk for chunk in chunks if not self._sound(chunk)]

    def write(self, chunk: Chunk, answers: Answers) -> None:
        """Keep the answers of a chunk."""
        dims = {"start": "p", "estimate": "p", "standard_error": "p", "coordinates": "d"}
        variables = {n: (("cell", dims[n]) if n in dims else ("cell",), values) for n, values in answers.items()}
        dataset = xarray.Dataset(
            variables, attrs={"plan": self.name, "layout": self.layout, **dataclasses.asdict(chunk)}
        )
        # through memory: HDF5 prints its own errors where a disk is full
        self.keep(self._path(chunk), bytes(dataset.to_netcdf(engine=_ENGINE)))

    def keep(self, path: Path, content: bytes) -> None:
        """Write `content` to the file `path` of the sweep and list it in the manifest.

        Raises `OutputError` where it cannot be written.
        """
        manifest = Manifest.of_folder(self.folder)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            manifest.begin("sweep")
            with written_whole(path) as beside:
                beside.write_bytes(content)
                manifest.add(path, beside)
        except OSError as error:
            what = f"cannot be written ({error.strerror or error})"
            raise OutputError(str(path), what, "make room there; the same command goes on from what is done") from error

    def tidy(self) -> None:
        """Remove what dead writers left behind."""
        for folder in (self.folder, self.folder / CELLS):
            if folder.is_dir():
                clear_dead(folder)

    def _path(self, chunk: Chunk) -> Path:
        return self.folder / CELLS / f"case{chunk.case:04d}-{chunk.first:09d}-{chunk.last:09d}.nc"

    def _sound(self, chunk: Chunk) -> bool:
        path = self._path(chunk)
        if not path.exists():
            return False
        try:
            with xarray.open_dataset(path, engine=_ENGINE) as held:
                return held.attrs["plan"] == self.name and held.sizes["cell"] == chunk.last - chunk.first
        except _UNREADABLE:
            return False


def check_folder(folder: Path, plan: Plan) -> dict[str, Any] | None:
    """What `kept_plan` gives, or, where that is damaged, what the chunks have of `plan`.

    **Raises** `InputError` also where `folder` holds another plan than `plan`.
    """
    wanted = described(plan)
    try:
        kept = kept_plan(folder)
    except InputError:
        kept = _from_chunks(folder, wanted)
    differing = difference(kept["plan"], wanted) if kept is not None else None
    if differing:
        what = f"holds another sweep: {differing}"
        raise InputError(str(folder), what, "choose another --out, or add --overwrite to begin anew")
    return kept


def kept_plan(folder: Path) -> dict[str, Any] | None:
    """What `plan.json` in `folder` holds; None where there is no folder yet, or an empty one.

    **Raises** `InputError` for a folder, or a file, that is something else.
    """
    if not folder.exists() or (folder.is_dir() and all(left.name.startswith(".jaxsub") for left in folder.iterdir())):
        return None
    content = _readable(folder)
    if content is not None:
        return content
    count = len(chunk_files(folder))
    what = f"has no {PLAN} that can be read"
    if count:
        what, remedy = (
            f"{what}, beside {count} chunks",
            f"give the command that began the sweep, which makes {PLAN} anew",
        )
    else:
        what, remedy = f"exists and is no folder of a sweep: it {what}", "choose another --out"
    raise InputError(str(folder), what, remedy)


def _readable(folder: Path) -> dict[str, Any] | None:
    """The content of `plan.json`, None where it is damaged: not as it was written."""
    manifest = Manifest.of_folder(folder)
    try:
        if manifest.exists() and not manifest.lists(folder / PLAN):
            return None
        content = json.loads((folder / PLAN).read_text(encoding="utf-8"))
        return content if {"plan", "layout"} <= set(content) else None
    except (OSError, ValueError, TypeError):
        return None


def _from_chunks(folder: Path, wanted: dict[str, Any]) -> dict[str, Any]:
    """The plan that is `wanted` with the layout that a chunk of it has. Raises `InputError` where none is of it."""
    chunks = chunk_files(folder)
    for path in chunks:
        try:
            with xarray.open_dataset(path, engine=_ENGINE) as held:
                if held.attrs["plan"] == name_of(wanted):
                    return {"plan": wanted, "layout": json.loads(held.attrs["layout"])}
        except _UNREADABLE:
            continue
    if not chunks:
        kept_plan(folder)
    what = f"{PLAN} cannot be read and none of the {len(chunks)} chunks beside it is of the sweep that this command is"
    raise InputError(str(folder), what, "give the command that began it, or choose another --out")


def chunk_files(folder: Path) -> list[Path]:
    """The files of the chunks that are done."""
    return sorted((folder / CELLS).glob("case*.nc"))


def read_chunk(path: Path, name: str) -> tuple[Chunk, dict[str, np.ndarray]] | None:
    """A chunk and its answers, or None where the file is not whole or of another plan."""
    try:
        with xarray.open_dataset(path, engine=_ENGINE) as held:
            if held.attrs["plan"] != name:
                return None
            chunk = Chunk(*(int(held.attrs[field.name]) for field in dataclasses.fields(Chunk)))
            return chunk, {str(variable): held[variable].values for variable in held.data_vars}
    except _UNREADABLE:
        return None
