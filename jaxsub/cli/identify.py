"""`jaxsub identify`: coefficients with standard errors, and what the recordings leave open."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from ..discrepancy import batch
from ..errors import InputError
from ..estimate import Fit, fit
from ..identifiability import Identifiability, identifiability
from ..results import RESULTS
from ..vehicle import read_vehicle, write_vehicle
from . import session
from .output import fresh_folder, refuse_existing


def run(vehicle_path: Path, runs: Sequence[Path], out: Path, overwrite: bool) -> None:
    """Fit the vehicle to the recordings; write `fitted.toml`, `coefficients.csv` and `identification.json`."""
    session.start()
    refuse_existing(out, overwrite)
    vehicle = read_vehicle(vehicle_path)
    recordings = session.load_runs(runs, vehicle)
    with fresh_folder(out, overwrite) as folder:
        with session.progress(f"identifying {vehicle.layout.name}") as told:
            told("fitting")
            found = fit(vehicle, batch(vehicle, recordings))
        if bool(found.result == RESULTS.nan_start):
            raise InputError(
                str(vehicle_path), "the model does not run from these values", "give values that are closer"
            )
        said = identifiability(found)
        _write(found, said, folder)
    _show(found, said)


def _write(found: Fit, said: Identifiability, folder: Path) -> None:
    write_vehicle(found.vehicle, folder / "fitted.toml", "fitted by jaxsub")
    units = {row.name: row.unit for row in found.vehicle.layout.free}
    with (folder / "coefficients.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["name", "value", "standard_error", "unit"])
        errors = found.standard_errors
        table.writerows([name, value, errors[name], units[name]] for name, value in found.values.items())
    content = {
        "schema": 1,
        "result": "successful" if bool(found.result == RESULTS.successful) else RESULTS[found.result],
        "cost": float(found.cost),
        "gradient_norm": float(found.gradient_norm),
        "steps": int(found.steps),
        "fit": found.rms,
        "identifiability": {
            "rank": said.rank, "parameters": said.parameters, "null_directions": said.null_directions
        },
        "coefficients": {n: {"value": v, "standard_error": found.standard_errors[n]} for n, v in found.values.items()},
    }  # fmt: skip
    (folder / "identification.json").write_text(json.dumps(content, indent=1), encoding="utf-8")


def _show(found: Fit, said: Identifiability) -> None:
    for sentence in said.sentences():
        session.console.print(sentence, highlight=False, markup=False)
    table = Table("coefficient", "value", "standard error")
    for name, value in found.values.items():
        table.add_row(escape(name), f"{value:.6g}", f"{found.standard_errors[name]:.2g}")
    session.console.print(table)
