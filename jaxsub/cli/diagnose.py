"""`jaxsub diagnose`: the whole path."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from rich.panel import Panel
from rich.text import Text

from ..discrepancy import Diagnosis
from ..discrepancy import diagnose as diagnose_runs
from ..discrepancy.next_run import next_run, said
from ..effects import AbstractEffect, from_script, vocabulary
from ..plain import to_json
from ..recording import Recording, hold_out, save
from ..report import write_report
from ..vehicle import AbstractVehicle, read_vehicle, vehicle_text
from . import session, terminal
from .output import fresh_folder, paths_of, require_replaceable
from .runs import load_train_and_test

_NEXT = "next_manoeuvre.csv"


def run(
    vehicle_path: Path,
    runs: Sequence[Path],
    held: Sequence[Path],
    out: Path,
    overwrite: bool,
    script: Path | None = None,
    manoeuvre: bool = True,
    columns: Path | None = None,
) -> None:
    """Diagnose the recordings at `runs`, judged on those at `held` or on what `hold_out` sets aside.

    Effects that the Python file at `script` defines are tried with those that are installed. Of logs the file at
    `columns` says what to take.
    """
    session.start()
    inputs = paths_of(vehicle_path, *runs, *held, script, columns)
    require_replaceable(out, overwrite, inputs)
    own = () if script is None else from_script(script)
    vehicle = read_vehicle(vehicle_path, own)
    recordings, unseen = load_train_and_test(runs, held, vehicle, columns)
    train, judged = (recordings, unseen) if held else hold_out(recordings)
    with fresh_folder(out, overwrite, inputs) as folder:
        diagnosis = write_diagnosis(vehicle, train, judged, folder, (*vocabulary(), *own), manoeuvre)
    terminal.emit(diagnosis.to_json(), lambda: show(diagnosis, out))


def write_diagnosis(
    vehicle: AbstractVehicle,
    train: Sequence[Recording],
    held: Sequence[Recording],
    folder: Path,
    kinds: tuple[type[AbstractEffect], ...] | None = None,
    manoeuvre: bool = True,
) -> Diagnosis:
    """Diagnose, and write `diagnosis.json`, `improved.toml`, `report.html` and `figures/` into `folder`.

    Where rivals remain and a `manoeuvre` is wanted, `next_manoeuvre.csv` holds inputs that would tell them apart.
    """
    with terminal.progress(f"diagnosing {vehicle.layout.name}") as told:
        diagnosis, improved = diagnose_runs(vehicle, train, held, vocabulary=kinds, progress=told)
        if manoeuvre and diagnosis.explanations:
            told("looking for the manoeuvre that would settle it")
            diagnosis = _with_next_run(diagnosis, train, folder)
        told("writing the report")
        text = vehicle_text(improved, f"{vehicle.layout.name}, improved by jaxsub\n{diagnosis.summary}")
        (folder / "improved.toml").write_text(text, encoding="utf-8")
        (folder / "diagnosis.json").write_text(to_json(diagnosis.to_json()), encoding="utf-8")
        write_report(diagnosis, text, folder)
    return diagnosis


def _with_next_run(diagnosis: Diagnosis, train: Sequence[Recording], folder: Path) -> Diagnosis:
    """The diagnosis with what is said of the next manoeuvre, which is written beside it."""
    found = next_run(diagnosis, train)
    if found is None:
        return diagnosis
    save(found.recording, folder / _NEXT)
    return dataclasses.replace(diagnosis, next_manoeuvre=f"{diagnosis.next_manoeuvre}. {said(found, _NEXT)}")


def show(diagnosis: Diagnosis, out: Path) -> None:
    """The verdict on the terminal."""
    held = diagnosis.fit["held_out"]
    channel = max(held["baseline"], key=lambda c: held["baseline"][c] / max(held["improved"][c], 1e-12))
    gain = f"held-out rms/σ of {channel}: {held['baseline'][channel]:.2f} before, {held['improved'][channel]:.2f} after"
    terminal.results.print(Panel(Text(f"{diagnosis.summary}\n{gain}"), title=diagnosis.verdict, expand=False))
    terminal.say(f"report: {out / 'report.html'}")
