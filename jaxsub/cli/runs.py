"""Recordings as commands take them: read, checked, and their findings printed."""

import os
from collections.abc import Sequence
from pathlib import Path

from ..api.recordings import checked
from ..checks import Checked
from ..errors import InputError
from ..findings import Finding
from ..recording import Recording, load, read_selection
from ..vehicle import AbstractVehicle, check_units
from . import terminal


def load_runs(paths: Sequence[Path], vehicle: AbstractVehicle, columns: Path | None = None) -> list[Recording]:
    """The recordings at `paths` as they will be used: see `load_train_and_test`."""
    return load_train_and_test(paths, (), vehicle, columns)[0]


def load_train_and_test(
    paths: Sequence[Path], held_out: Sequence[Path], vehicle: AbstractVehicle, columns: Path | None = None
) -> tuple[list[Recording], list[Recording]]:
    """The recordings at `paths` and those at `held_out`, masked, unwrapped and cut as `check` says.

    Of logs the file at `columns` says what to take. Warnings and notes are printed. Raises InputError as `checked_runs`
    does.
    """
    used = checked_runs(paths, held_out, vehicle, columns)
    terminal.warn(used.findings)
    return list(used.recordings), list(used.held_out)


def checked_runs(
    paths: Sequence[Path], held_out: Sequence[Path], vehicle: AbstractVehicle, columns: Path | None = None
) -> Checked:
    """What `check` finds in the recordings, none of it an error.

    Raises InputError for the first finding that is one, and for a file that is given twice.
    """
    require_once(paths, held_out)
    read = lambda group: [load_run(path, vehicle, columns) for path in group]
    return checked(vehicle, read(paths), read(held_out))


def checked_run(recording: Recording, vehicle: AbstractVehicle) -> Recording:
    """The recording, checked, in one piece. Raises InputError where a hole in time cuts it."""
    used = checked(vehicle, recording)
    if len(used.recordings) > 1:
        gap = next(finding for finding in used.findings if finding.check == "time-gap" and finding.remedy)
        raise InputError(gap.place, gap.what.partition(":")[0], "cut the run there and give its parts one by one")
    terminal.warn(used.findings)
    return next(iter(used.recordings))


def load_run(path: Path, vehicle: AbstractVehicle, columns: Path | None = None) -> Recording:
    """The recording at `path`; of a log, inputs are held and prescribed motions interpolated as `vehicle` has them."""
    chosen = None if columns is None else read_selection(columns)
    recording = load(path, chosen, held=vehicle.layout.held, interpolated=vehicle.layout.interpolated)
    check_units(vehicle.layout, [recording])
    return recording


def require_once(paths: Sequence[Path], held_out: Sequence[Path] = ()) -> None:
    """Raise InputError where two of the paths lead to one file."""
    for finding in repeated_paths(paths, held_out):
        raise finding.error()


def repeated_paths(paths: Sequence[Path], held_out: Sequence[Path] = ()) -> list[Finding]:
    """An error for each path that leads to the file of an earlier one."""
    findings, every = [], [*paths, *held_out]
    for index, path in enumerate(every):
        for other, earlier in enumerate(every[:index]):
            if path.exists() and earlier.exists() and os.path.samefile(path, earlier):
                role = "as a run and held out" if other < len(paths) <= index else "twice"
                what = f"is the file {earlier}" if str(earlier) != str(path) else "is one file"
                findings.append(Finding("same-run", "error", str(path), f"{what}, given {role}", "give every run once"))
                break
    return findings
