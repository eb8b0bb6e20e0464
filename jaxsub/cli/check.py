"""`jaxsub check`: what is wrong or odd with runs, before any fit."""

import dataclasses
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from ..checks import Checked, check, from_error
from ..checks.channels import Channel, channels_of
from ..errors import InputError
from ..findings import Finding
from ..plain import to_json
from ..recording import Recording
from ..report import draw_checked_runs, write_figures
from ..vehicle import AbstractVehicle, read_vehicle
from . import session, terminal
from .output import fresh_folder, paths_of
from .runs import load_run, repeated_paths


def run(
    vehicle_path: Path,
    runs: Sequence[Path],
    held_out: Sequence[Path] = (),
    out: Path | None = None,
    overwrite: bool = False,
    columns: Path | None = None,
) -> None:
    """Print what checks find in `runs`, and write `check.json` and `figures/` into `out`, if given.

    A run that cannot be read is a finding like others. Exits with 2 where one finding is an error.
    """
    session.start()
    inputs = paths_of(vehicle_path, *runs, *held_out, columns)
    with fresh_folder(out, overwrite, inputs) if out is not None else nullcontext() as folder:
        vehicle = read_vehicle(vehicle_path)
        recordings, checked = _checked(vehicle, runs, held_out, columns)
        content = _content(vehicle, checked)
        terminal.emit(content, lambda: _show(content, checked))
        if folder is not None:
            with terminal.progress("drawing"):
                _write(vehicle, recordings, checked, content, folder)
    terminal.count(checked.findings)
    if checked.errors:
        sys.exit(2)


def _checked(
    vehicle: AbstractVehicle, runs: Sequence[Path], held_out: Sequence[Path], columns: Path | None
) -> tuple[list[Recording], Checked]:
    """The recordings that can be read, as they are in their files, and what checks find in them."""
    unread: list[Finding] = repeated_paths(runs, held_out)
    read = [_read(path, vehicle, columns, unread) for path in runs]
    unseen = [_read(path, vehicle, columns, unread) for path in held_out]
    recordings, held = [r for r in read if r], [r for r in unseen if r]
    checked = check(vehicle, recordings, held)
    # a file given twice is one finding, not also the equal samples that follow from it
    known = {finding.where for finding in unread}
    later = [finding for finding in checked.findings if finding.check != "same-run" or finding.where not in known]
    return [*recordings, *held], dataclasses.replace(checked, findings=(*unread, *later))


def _read(path: Path, vehicle: AbstractVehicle, columns: Path | None, unread: list[Finding]) -> Recording | None:
    try:
        return load_run(path, vehicle, columns)
    except InputError as error:
        unread.append(from_error("file", error))
        return None


def _content(vehicle: AbstractVehicle, checked: Checked) -> dict[str, Any]:
    every = [*checked.recordings, *checked.held_out]
    channels = [
        {
            "run": recording.source,
            "name": recording.name,  # the pieces of a run that was cut have one source
            "channel": channel.name,
            "role": channel.role,
            **_numbers(recording, channel),
        }
        for recording in every
        for channel in channels_of(vehicle.layout)
        if channel.name in recording.columns
    ]
    return {
        "schema": 1,
        "vehicle": vehicle.layout.name,
        "errors": len(checked.errors),
        "warnings": sum(finding.severity == "warning" for finding in checked.findings),
        "findings": [finding.to_json() for finding in checked.findings],
        "channels": channels,
    }


def _numbers(recording: Recording, channel: Channel) -> dict[str, Any]:
    values = recording.columns[channel.name]
    there = values[np.isfinite(values)]
    return {
        "unit": channel.unit,
        "samples": int(there.size),
        "missing": int(values.size - there.size),
        "least": float(there.min()) if there.size else None,
        "largest": float(there.max()) if there.size else None,
    }


def _write(
    vehicle: AbstractVehicle, recordings: Sequence[Recording], checked: Checked, content: dict[str, Any], folder: Path
) -> None:
    (folder / "check.json").write_text(to_json(content), encoding="utf-8")
    channels = [(channel.name, channel.unit) for channel in channels_of(vehicle.layout)]
    write_figures(draw_checked_runs(recordings, channels, checked.findings), folder)


def _show(content: dict[str, Any], checked: Checked) -> None:
    rows = [_channel_row(channel, checked) for channel in content["channels"]]
    if rows:
        terminal.table(("run", "channel", "role", "samples", "missing", "range", "unit", "found"), rows)
    listed = [_row(finding) for finding in checked.findings]
    if listed:
        terminal.table(("severity", "check", "where", "channel", "rows", "times (s)", "what"), listed)
    errors, warnings = content["errors"], content["warnings"]
    counts = {"error": errors, "warning": warnings, "note": len(checked.findings) - errors - warnings}
    terminal.say(", ".join(f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items()))


def _channel_row(channel: dict[str, Any], checked: Checked) -> tuple[str, ...]:
    name, where = channel["channel"], channel["run"]
    span = f"{channel['least']:.4g} to {channel['largest']:.4g}" if channel["samples"] else "none"
    found = sorted({finding.check for finding in checked.findings if (finding.where, finding.channel) == (where, name)})
    counts = (str(channel["samples"]), str(channel["missing"]))
    return (channel["name"], name, channel["role"], *counts, span, channel["unit"], ", ".join(found))


def _row(finding: Finding) -> tuple[str, ...]:
    text = f"{finding.what}{f'; {finding.remedy}' if finding.remedy else ''}"
    spans = (_spans(finding.rows), _spans(finding.times))
    return (finding.severity, finding.check, finding.where, finding.channel, *spans, " ".join(text.split()))


def _spans(pairs: Sequence[tuple[int, int]] | Sequence[tuple[float, float]]) -> str:
    shown = [f"{a:.7g}" if a == b else f"{a:.7g} to {b:.7g}" for a, b in pairs[:3]]
    more = [f"{len(pairs) - 3} more"] if len(pairs) > 3 else []
    return ", ".join([*shown, *more])
