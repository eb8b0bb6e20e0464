"""`jaxsub identify`: coefficients with standard errors, whether they explain the runs, and what the runs leave open."""

import dataclasses
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, OutputError
from ..estimate import METHODS, Passes, Solution, assess, batch, fit, posterior, require_free
from ..information import coloured_covariance, identifiability
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle, read_vehicle
from . import session, terminal
from .effort import Effort, TimeLeft, return_memory
from .identification import Identification
from .interruption import interruptible
from .options import options
from .output import Fresh, fresh_folders, paths_of
from .runs import load_runs

_FOLLOWS = "computing standard errors and identifiability"


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
    The fit is put at `out` as soon as it is there, and stays there whatever ends what follows; the verdict is shown
    before the rest is written.
    """
    session.start(recordings=runs)
    return_memory()
    with fresh_folders(out, overwrite, paths_of(vehicle_path, *runs, columns)) as fresh:
        vehicle = read_vehicle(vehicle_path)
        require_free(vehicle, str(vehicle_path))
        recordings = load_runs(runs, vehicle, columns)
        stacked = batch(vehicle, recordings).padded()
        del recordings
        effort = Effort(vehicle, stacked)
        if announcement := effort.announcement():
            terminal.note(announcement)
        with terminal.progress(f"identifying {vehicle.layout.name}") as told:
            told(f"fitting by {method}")
            found = _fitted(vehicle, stacked, method, str(vehicle_path), TimeLeft(told, f"fitting by {method}"))
            fitted = Identification(found, method, ", ".join(map(str, runs)), assess(found), None, None, False)
            _keep(fitted, fresh, out)
            told(_FOLLOWS)
            identified = _followed(fitted, TimeLeft(told, _FOLLOWS))
        terminal.emit(identified.to_json(), lambda: _show(identified))
        terminal.warn(identified.findings)
        with fresh() as folder:
            identified.write(folder)
            if drawn and identified.complete:
                with terminal.progress(f"identifying {vehicle.layout.name}") as told:
                    told("drawing from the posterior")
                    _write_posterior(posterior(found), folder / "posterior.nc")
    if not identified.complete:
        options().kept = f"{out} holds the fit, and what followed it so far"
        raise KeyboardInterrupt


def _keep(fitted: Identification, fresh: Fresh, out: Path) -> None:
    """Put the fit at `out`. Where it cannot be written, the command ends only once the verdict has been shown."""
    with suppress(OutputError):
        with fresh() as folder:
            fitted.write(folder)
        options().kept = f"{out} holds the fit"


def _write_posterior(drawn: Any, path: Path) -> None:
    """Write draws as NetCDF, by way of another folder: where the results' disk is full HDF5 prints its own errors."""
    with tempfile.TemporaryDirectory() as folder:
        drawn.to_netcdf(str(Path(folder) / path.name), engine="h5netcdf")
        path.write_bytes((Path(folder) / path.name).read_bytes())


def _fitted(vehicle: AbstractVehicle, runs: Runs, method: str, where: str, passes: Passes) -> Solution:
    """The fit of the vehicle, read from `where`. **Raises** `InputError` where the model does not run."""
    # Gauss–Newton by its own name is what `fit` does unasked, and that finds a start where the file's does not run
    chosen = None if method == "gauss-newton" else METHODS[method.replace("-", "_")]()
    found = fit(vehicle, runs, method=chosen, passes=passes)
    if not np.isfinite(float(found.cost)):
        what = "the model does not run from these values"
        raise InputError(where, what, "give values that are closer, or another --method")
    return found


def _followed(fitted: Identification, passes: Passes) -> Identification:
    """The fit and what follows from it, as far as it came before an interruption."""
    found, watch = fitted.fit, options().watch
    with suppress(KeyboardInterrupt):
        coloured = interruptible(
            lambda: coloured_covariance(found, None, lambda share: passes(2.0 * share, 3.0)), watch
        )
        fitted = dataclasses.replace(fitted, coloured=coloured)
        last = lambda share: passes(2.0 + share, 3.0)
        said = interruptible(lambda: identifiability(found, fitted.assessment, last), watch)
        fitted = dataclasses.replace(fitted, said=said, complete=True)
    return fitted


def _show(identified: Identification) -> None:
    terminal.say(f"The fit {identified.assessment.verdict()}.")
    terminal.table(*identified.channel_table())
    for sentence in identified.sentences():
        terminal.say(sentence)
    terminal.table(*identified.coefficient_table())
