"""`jaxsub init`: a vehicle file to start from."""

import tomllib
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..recording import Recording, load, read_selection
from ..vehicle import initial_file, published_file, rig_file, vehicle_from
from . import session, terminal
from .output import fresh_file, paths_of


def run(
    kind: str | None,
    like: str | None,
    sizes: Mapping[str, float],
    log: Path | None = None,
    columns: Path | None = None,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Write the file of a vehicle of that `kind` and `sizes` (SI), or of the published one `like`, or print it.

    Its inputs and outputs are those columns of the `log` that it has; of a vehicle's log, the file at `columns` says
    which to take.
    """
    session.start()
    with fresh_file(out, overwrite, paths_of(log, columns)) if out is not None else nullcontext() as path:
        recording = None if log is None else load(log, None if columns is None else read_selection(columns))
        text, unused = _begun(kind, like, sizes, recording)
        vehicle = vehicle_from(tomllib.loads(text), str(out or like or kind))
        if path is not None:
            path.write_text(text, encoding="utf-8")
    content = {
        "schema": 1,
        "out": out,
        "file": text,
        "inputs": dict(vehicle.layout.inputs),
        "outputs": list(vehicle.layout.channels),
        "free": len(vehicle.layout.free),
        "unused": unused,
    }
    terminal.emit(content, lambda: terminal.say(text.rstrip() if out is None else _summary(content)))


def _begun(
    kind: str | None, like: str | None, sizes: Mapping[str, float], log: Recording | None
) -> tuple[str, list[str]]:
    """The text of the file, and the columns of the log that it does not use."""
    if like is not None:
        if given := [kind, *sizes][0 if kind else 1 :]:
            raise InputError("--like", f"is given beside {given[0]}", "a published vehicle has its kind and dimensions")
        return published_file(like, log)
    if kind is None:
        raise InputError("jaxsub init", "has no kind of vehicle", "give auv, rov and the like, or --like")
    if kind == "rig":
        if log is None:
            raise InputError("jaxsub init rig", "has no log", "give --log run.csv, whose columns are the rig's")
        if sizes:
            raise InputError(
                f"--{next(iter(sizes))}", "is no dimension of a rig", "delete it; a rig is begun by its log"
            )
        return rig_file(log)
    file = initial_file(kind, sizes, log)
    return file.text(), file.unused


def _summary(content: dict[str, Any]) -> str:
    inputs = ", ".join(f"{name} = {column}" for name, column in content["inputs"].items()) or "none"
    line = f"{content['out']}: {content['free']} free numbers; inputs {inputs}"
    return f"{line}; outputs {', '.join(content['outputs'])}; not used {', '.join(content['unused']) or 'none'}"
