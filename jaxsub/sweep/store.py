"""The folder that a sweep is kept in: `plan.json`, and a NetCDF file for each chunk that is done.

A file is written beside its place and moved there once it is whole, so what is there is done, whenever the sweep was
interrupted. A file that cannot be read, as after a failure of the disk, counts as missing.
"""

import dataclasses
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from ..errors import InputError
from .described import described, difference, layout, name_of
from .plan import Chunk, Plan
from .run import Answers

PLAN, CELLS, _SCRATCH = "plan.json", "cells", ".writing-"
_ENGINE, _UNREADABLE = "h5netcdf", (OSError, KeyError, ValueError)


@dataclasses.dataclass(frozen=True)
class Store:
    """A sweep's folder, of the plan named `name`."""

    folder: Path
    name: str

    @classmethod
    def of(cls, folder: Path, plan: Plan) -> tuple["Store", Plan]:
        """The store of `plan` in `folder`, begun or found there, and the plan with what was settled when it was begun.

        **Raises** `InputError`, and leaves the folder as it is, where that holds another plan or something else.
        """
        kept, wanted = check_folder(folder, plan), described(plan)
        if kept is not None:
            settled = dataclasses.replace(plan, sigma=kept["layout"]["sigma"], width=kept["layout"]["width"])
            return cls(folder, name_of(wanted)), settled
        settled = plan.settled()
        content = {"plan": wanted, "layout": layout(settled)}
        with _moved_into_place(folder / PLAN) as path:
            path.write_text(json.dumps(content, indent=1), encoding="utf-8")
        return cls(folder, name_of(wanted)), settled

    def missing(self, chunks: Iterable[Chunk]) -> list[Chunk]:
        """Those of the chunks that are not done."""
        return [chunk for chunk in chunks if not self._sound(chunk)]

    def write(self, chunk: Chunk, answers: Answers) -> None:
        """Keep the answers of a chunk."""
        dims = {"start": "p", "estimate": "p", "standard_error": "p", "coordinates": "d"}
        variables = {n: (("cell", dims[n]) if n in dims else ("cell",), values) for n, values in answers.items()}
        dataset = xarray.Dataset(variables, attrs={"plan": self.name, **dataclasses.asdict(chunk)})
        with _moved_into_place(self._path(chunk)) as path:
            dataset.to_netcdf(path, engine=_ENGINE)

    def tidy(self) -> None:
        """Remove what interrupted writers left behind; only where nobody writes any more."""
        for left in (*self.folder.glob(f"{_SCRATCH}*"), *(self.folder / CELLS).glob(f"{_SCRATCH}*")):
            shutil.rmtree(left, ignore_errors=True)

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
    """What `kept_plan` gives. Raises `InputError` also where `folder` holds another plan than `plan`."""
    kept = kept_plan(folder)
    told = difference(kept["plan"], described(plan)) if kept is not None else None
    if told:
        what = f"holds another sweep: {told}"
        raise InputError(str(folder), what, "choose another --out, or add --overwrite to begin anew")
    return kept


def kept_plan(folder: Path) -> dict[str, Any] | None:
    """What `plan.json` in `folder` holds; None where there is no folder yet, or an empty one.

    **Raises** `InputError` for a folder, or a file, that is something else.
    """
    if not folder.exists() or (folder.is_dir() and all(left.name.startswith(_SCRATCH) for left in folder.iterdir())):
        return None
    try:
        content = json.loads((folder / PLAN).read_text(encoding="utf-8"))
        if {"plan", "layout"} <= set(content):
            return content
        raise KeyError("plan")
    except (OSError, ValueError, KeyError, TypeError) as error:
        what = f"exists and is no folder of a sweep: it has no {PLAN} that can be read"
        raise InputError(str(folder), what, "choose another --out, or add --overwrite") from error


@contextmanager
def _moved_into_place(path: Path) -> Iterator[Path]:
    """A path to write to, in a folder beside `path`, whose file takes its place when the block ends well."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=_SCRATCH) as scratch:
        beside = Path(scratch) / path.name
        yield beside
        with beside.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(beside, path)


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
