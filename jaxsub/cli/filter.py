"""`jaxsub filter`: states with the vehicle's dynamics as motion model, and how they drift while a sensor is out."""

from collections.abc import Sequence
from pathlib import Path

from ..api.dead_reckoning import dead_reckon
from ..estimate import Outage
from ..plain import to_json
from ..vehicle import read_vehicle
from . import session, terminal
from .output import fresh_folder, paths_of
from .runs import load_runs


def run(
    vehicle_path: Path,
    runs: Sequence[Path],
    out: Path,
    outages: Sequence[str],
    improved_path: Path | None,
    overwrite: bool,
    columns: Path | None = None,
) -> None:
    """Write the states of each run as recordings, and `filter.json`, into `out`; show what drifts in the outages.

    Of logs the file at `columns` says what to take.
    """
    session.start(recordings=runs)
    absent = [Outage.of(text) for text in outages]
    with fresh_folder(out, overwrite, paths_of(vehicle_path, *runs, columns, improved_path)) as folder:
        vehicle = read_vehicle(vehicle_path)
        improved = None if improved_path is None else read_vehicle(improved_path)
        recordings = load_runs(runs, vehicle, columns)
        with terminal.progress(f"filtering {vehicle.layout.name}") as progress:
            progress("filtering and smoothing")
            found = dead_reckon(vehicle, recordings, outages=absent, improved=improved)
        content = found.to_json()
        terminal.emit(content, lambda: terminal.show(found.parts()))
        found.write(folder)
        (folder / "filter.json").write_text(to_json(content), encoding="utf-8")
