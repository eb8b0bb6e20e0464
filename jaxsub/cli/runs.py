"""Recordings as commands take them: read, checked, and their findings printed."""

from collections.abc import Sequence
from pathlib import Path

from ..recording import Recording, load, read_selection
from ..vehicle import AbstractVehicle
from . import terminal


def load_runs(paths: Sequence[Path], vehicle: AbstractVehicle, columns: Path | None = None) -> list[Recording]:
    """The recordings at `paths`, refused at once where a column that `vehicle` needs is absent or has a gap.

    Of logs the file at `columns` says what to take.
    """
    recordings = [load_run(path, vehicle, columns) for path in paths]
    layout = vehicle.layout
    for recording in recordings:
        recording.inputs([*layout.held, *layout.interpolated])
        for channel in layout.channels:
            recording.column(channel)
        terminal.warn(recording.findings)
    return recordings


def load_run(path: Path, vehicle: AbstractVehicle, columns: Path | None = None) -> Recording:
    """The recording at `path`; of a log, inputs are held and prescribed motions interpolated as `vehicle` has them."""
    chosen = None if columns is None else read_selection(columns)
    return load(path, chosen, held=vehicle.layout.held, interpolated=vehicle.layout.interpolated)
