"""Diagnosing a real set from files, as a user would, and keeping everything in one folder."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from jaxsub.cli.diagnose import show, write_diagnosis
from jaxsub.discrepancy import Diagnosis
from jaxsub.recording import Recording
from jaxsub.vehicle import read_vehicle


def diagnose_files(
    vehicle_text: str, train: Sequence[Recording], held: Sequence[Recording], folder: Path
) -> tuple[Diagnosis, dict[str, dict[str, float]]]:
    """The diagnosis, written into `folder` beside the vehicle file; held-out rms by channel (SI) after each effect."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "vehicle.toml").write_text(vehicle_text, encoding="utf-8")
    shutil.rmtree(folder / "figures", ignore_errors=True)
    diagnosis = write_diagnosis(read_vehicle(folder / "vehicle.toml"), train, held, folder)
    show(diagnosis, folder)
    return diagnosis, dict(diagnosis.history)
