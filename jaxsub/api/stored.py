"""What a saved result has beside the files of the commands, so that it can be loaded again: `result.npz`.

It holds the recordings as they were used, arrays by name, and the rest as JSON: `{"schema": 1, "kind": …, …}`. Numbers
are exact.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..findings import Finding
from ..plain import to_json
from ..recording import Recording
from ..storage import opened_archive, write_archive

RESULT = "result.npz"
_SCHEMA, _TEXT = 1, "content"


class Stored(NamedTuple):
    """A result as it was stored: its text, its arrays by name, and the recordings that it is of."""

    text: dict[str, Any]
    arrays: dict[str, np.ndarray]
    recordings: tuple[Recording, ...]


def store(
    folder: Path,
    kind: str,
    text: Mapping[str, Any],
    arrays: Mapping[str, np.ndarray],
    recordings: Sequence[Recording],
) -> None:
    """Write the result of a `kind` into `folder`."""
    named = {f"own/{name}": array for name, array in arrays.items()}
    runs = []
    for index, run in enumerate(recordings):
        named[f"run/{index}/times"] = run.times
        named |= {f"run/{index}/{name}": values for name, values in run.columns.items()}
        findings = [finding.to_json() for finding in run.findings]
        runs.append({"name": run.name, "source": run.source, "first_row": run.first_row, "columns": list(run.columns),
                     "units": dict(run.units), "findings": findings})  # fmt: skip
    content = to_json({"schema": _SCHEMA, "kind": kind, "runs": runs, **text})
    write_archive(folder / RESULT, _TEXT, content, named)


def stored(folder: Path, kind: str) -> Stored:
    """What `store` wrote into `folder`.

    **Raises** `InputError` where there is no result of that `kind`, or one of another version.
    """
    path, remedy = folder / RESULT, f"give a folder that {kind}.save wrote"
    with opened_archive(path, _TEXT, "cannot be read", remedy) as (text, arrays):
        found = text["schema"], text["kind"]
        if found != (_SCHEMA, kind):
            raise InputError(str(path), f"is a {found[1]} of schema {found[0]}", remedy)
        own = {name.removeprefix("own/"): arrays[name] for name in arrays if name.startswith("own/")}
        recordings = tuple(_recording(index, run, arrays) for index, run in enumerate(text.pop("runs")))
        return Stored(text, own, recordings)


def _recording(index: int, run: dict[str, Any], arrays: Mapping[str, np.ndarray]) -> Recording:
    columns = {name: arrays[f"run/{index}/{name}"] for name in run["columns"]}
    times, findings = arrays[f"run/{index}/times"], findings_of(run["findings"])
    return Recording(run["name"], times, columns, run["source"], run["first_row"], run["units"], findings=findings)


def findings_of(listed: Sequence[Mapping[str, Any]]) -> tuple[Finding, ...]:
    """Findings from JSON."""
    pairs = lambda one: {key: tuple(map(tuple, one[key])) for key in ("rows", "times")}
    return tuple(Finding(**{**one, **pairs(one)}) for one in listed)
