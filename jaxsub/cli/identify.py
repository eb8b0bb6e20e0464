"""`jaxsub identify`: coefficients with standard errors, and what the recordings leave open."""

import csv
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..discrepancy import batch
from ..errors import InputError
from ..estimate import METHODS, Fit, fit, posterior
from ..identifiability import Coloured, Identifiability, Verdict, coloured_covariance, identifiability
from ..plain import to_json
from ..report.text import unit
from ..results import RESULTS
from ..vehicle import read_vehicle, write_vehicle
from . import session, terminal
from .output import fresh_folder, refuse_existing
from .runs import load_runs


def run(
    vehicle_path: Path,
    runs: Sequence[Path],
    out: Path,
    method: str,
    overwrite: bool,
    columns: Path | None = None,
    drawn: bool = False,
) -> None:
    """Fit the vehicle to the recordings by `method`; write `fitted.toml`, `coefficients.csv`, `identification.json`.

    Of logs the file at `columns` says what to take. Where it is to be `drawn` from, the posterior is in `posterior.nc`.
    """
    session.start()
    refuse_existing(out, overwrite)
    vehicle = read_vehicle(vehicle_path)
    recordings = load_runs(runs, vehicle, columns)
    with fresh_folder(out, overwrite) as folder, terminal.progress(f"identifying {vehicle.layout.name}") as told:
        told(f"fitting by {method}")
        # Gauss–Newton by its own name is what `fit` does unasked, and that finds a start where the file's does not run
        chosen = None if method == "gauss-newton" else METHODS[method.replace("-", "_")]()
        found = fit(vehicle, batch(vehicle, recordings), method=chosen)
        if not np.isfinite(float(found.cost)):
            what = "the model does not run from these values"
            raise InputError(str(vehicle_path), what, "give values that are closer, or another --method")
        told("asking what the recordings identify")
        said, coloured = identifiability(found), coloured_covariance(found)
        _write(found, said, coloured, method, folder)
        if drawn:
            told("drawing from the posterior")
            posterior(found).to_netcdf(folder / "posterior.nc", engine="h5netcdf")
    _show(found, said, coloured)


def _write(found: Fit, said: Identifiability, coloured: Coloured, method: str, folder: Path) -> None:
    write_vehicle(found.vehicle, folder / "fitted.toml", "fitted by jaxsub")
    units = {row.name: row.unit for row in found.vehicle.layout.free}
    with (folder / "coefficients.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["name", "value", "standard_error", "unit", "standard_error_coloured", "verdict"])
        white, wide = found.standard_errors, coloured.standard_errors
        kind = {verdict.name: verdict.kind for verdict in said.verdicts}
        table.writerows([n, v, white[n], units[n], wide[n], kind[n]] for n, v in found.values.items())
    content = {
        "schema": 1,
        "method": method,
        "result": "successful" if bool(found.result == RESULTS.successful) else RESULTS[found.result],
        "cost": float(found.cost),
        "gradient_norm": float(found.gradient_norm),
        "steps": int(found.steps),
        "fit": found.rms,
        "identifiability": {
            "rank": said.rank,
            "parameters": said.parameters,
            "null_directions": said.null_directions,
            "equivalent_systems": [family.sentence() for family in said.families],
            "verdicts": [_plain(verdict) for verdict in said.verdicts],
        },
        "coefficients": {
            n: {"value": v, "standard_error": white[n], "standard_error_coloured": wide[n], "unit": units[n]}
            for n, v in found.values.items()
        },
    }
    (folder / "identification.json").write_text(to_json(content), encoding="utf-8")


def _plain(verdict: Verdict) -> dict:
    """A verdict as JSON has it, which knows no infinity."""
    told = dataclasses.asdict(verdict)
    return told | {"relative_error": verdict.relative_error if np.isfinite(verdict.relative_error) else None}


def _show(found: Fit, said: Identifiability, coloured: Coloured) -> None:
    for sentence in said.sentences():
        terminal.say(sentence)
    rows = []
    white, wide = found.standard_errors, coloured.standard_errors
    kind = {verdict.name: verdict.kind for verdict in said.verdicts}
    units = {row.name: unit(row.unit) for row in found.vehicle.layout.free}
    for name, value in found.values.items():
        spread = (f"{errors[name]:.2g}" for errors in (white, wide))
        rows.append((name, f"{value:.6g}", *spread, units[name], kind[name]))
    terminal.table(("coefficient", "value", "standard error", "if residuals are coloured", "unit", "verdict"), rows)
    if not bool(found.result == RESULTS.successful):
        away = f"{float(found.gradient_norm):.2g} standard errors from the optimum"
        terminal.say(f"Not converged: {RESULTS[found.result]} It is {away}.")
