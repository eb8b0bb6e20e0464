"""`jaxsub identify`: coefficients with standard errors, whether they explain the runs, and what the runs leave open."""

import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..api.fits import Fit, fitted
from ..errors import OutputError
from ..estimate import Passes, batch, posterior, require_free
from ..vehicle import read_vehicle
from . import session, terminal
from .effort import Effort, TimeLeft, return_memory
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
        stacked, names = batch(vehicle, recordings).padded(), [recording.name for recording in recordings]
        del recordings
        effort = Effort(vehicle, stacked)
        if announcement := effort.announcement():
            terminal.note(announcement)
        with terminal.progress(f"identifying {vehicle.layout.name}") as progress:
            progress(f"fitting by {method}")
            left = TimeLeft(progress, f"fitting by {method}")
            found = fitted(vehicle, stacked, list(map(str, runs)), names, method, file=str(vehicle_path), passes=left)
            _keep(found, fresh, out)
            progress(_FOLLOWS)
            identified = _followed(found, TimeLeft(progress, _FOLLOWS))
        terminal.emit(identified.to_json(), lambda: terminal.show(identified.parts_so_far()))
        terminal.warn(identified.warnings)
        with fresh() as folder:
            identified.write(folder)
            if drawn and identified.complete:
                with terminal.progress(f"identifying {vehicle.layout.name}") as progress:
                    progress("drawing from the posterior")
                    _write_posterior(posterior(found.solution), folder / "posterior.nc")
    if not identified.complete:
        options().kept = f"{out} holds the fit, and what followed it so far"
        raise KeyboardInterrupt


def _keep(found: Fit, fresh: Fresh, out: Path) -> None:
    """Put the fit at `out`. Where it cannot be written, the command ends only once the verdict has been shown."""
    with suppress(OutputError):
        with fresh() as folder:
            found.write(folder)
        options().kept = f"{out} holds the fit"


def _write_posterior(drawn: Any, path: Path) -> None:
    """Write draws as NetCDF, by way of another folder: where the results' disk is full HDF5 prints its own errors."""
    with tempfile.TemporaryDirectory() as folder:
        drawn.to_netcdf(str(Path(folder) / path.name), engine="h5netcdf")
        path.write_bytes((Path(folder) / path.name).read_bytes())


def _followed(found: Fit, passes: Passes) -> Fit:
    """The fit and what follows from it, as far as it came before an interruption."""
    watch = options().watch
    with suppress(KeyboardInterrupt):
        found = interruptible(lambda: found.allowing_colour(lambda share: passes(2.0 * share, 3.0)), watch)
        found = interruptible(lambda: found.identified(lambda share: passes(2.0 + share, 3.0)), watch)
    return found
