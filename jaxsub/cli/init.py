"""`jaxsub init`: a vehicle file to start from."""

import tomllib
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ..recording import load, read_selection
from ..vehicle import initial_file, vehicle_from
from . import session, terminal
from .output import fresh_file, paths_of


def run(
    kind: str,
    sizes: Mapping[str, float],
    log: Path | None = None,
    columns: Path | None = None,
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Write the file of a vehicle of that `kind` and `sizes` (SI) to `out`, or print it.

    Its inputs and outputs are those columns of the `log` that the kind has; of a vehicle's log, the file at `columns`
    says which to take.
    """
    session.start()
    inputs = paths_of(log, columns)
    with fresh_file(out, overwrite, inputs) if out is not None else nullcontext() as path:
        recording = None if log is None else load(log, None if columns is None else read_selection(columns))
        file = initial_file(kind, sizes, recording)
        text = file.text()
        vehicle = vehicle_from(tomllib.loads(text), str(out or kind))
        if path is not None:
            path.write_text(text, encoding="utf-8")
    layout = vehicle.layout
    content = {
        "schema": 1,
        "out": out,
        "file": text,
        "inputs": dict(layout.inputs),
        "outputs": list(layout.channels),
        "coefficients": len(file.coefficients),
        "unused": file.unused,
    }
    terminal.emit(content, lambda: terminal.say(text.rstrip() if out is None else _summary(content)))


def _summary(content: dict[str, Any]) -> str:
    inputs = ", ".join(f"{name} = {column}" for name, column in content["inputs"].items()) or "none"
    line = f"{content['out']}: {content['coefficients']} coefficients; inputs {inputs}"
    return f"{line}; outputs {', '.join(content['outputs'])}; not used {', '.join(content['unused']) or 'none'}"
