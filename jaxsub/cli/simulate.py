"""`jaxsub simulate`: the model's answer to a recording's inputs, and how far it is from what was measured."""

from pathlib import Path

from ..api.initial_states import Start, with_every_channel
from ..api.simulations import SimulatedRun, simulated
from ..recording import save
from ..vehicle import read_vehicle, vehicle_findings
from . import session, terminal
from .output import fresh_file, paths_of
from .runs import checked_run, load_run


def run(
    vehicle_path: Path,
    run_path: Path,
    out: Path,
    overwrite: bool,
    columns: Path | None = None,
    start: Start = "estimated",
) -> None:
    """Write the recording's inputs and the model's outputs to `out`, and show their errors where they were measured.

    The model starts at rest, from the recorded first samples, or from the initial state that the whole recording makes
    most probable, as `diagnose` and `identify` estimate it. Of a log, the file at `columns` says what to take.
    """
    session.start(recordings=[run_path])
    with fresh_file(out, overwrite, paths_of(vehicle_path, run_path, columns)) as path:
        vehicle = read_vehicle(vehicle_path)
        recording = checked_run(with_every_channel(load_run(run_path, vehicle, columns), vehicle), vehicle)
        with terminal.progress(f"simulating {vehicle.layout.name}"):
            found = simulated(vehicle, recording, start, str(vehicle_path))
        show(found, out)
        save(found.answer(out.stem, str(out)), path)


def show(found: SimulatedRun, out: Path) -> None:
    """The initial state and the errors of a simulation that goes to `out`, and what is to be said of them."""
    terminal.warn(found.findings)
    known = vehicle_findings(found.vehicle, found.vehicle.layout.name)
    warnings = [finding.to_json() for finding in (*known, *found.recording.findings, *found.findings)]
    terminal.emit(found.to_json() | {"out": out, "warnings": warnings}, lambda: terminal.show(found.brief()))
