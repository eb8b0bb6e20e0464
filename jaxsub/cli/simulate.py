"""`jaxsub simulate`: the model's answer to a recording's inputs."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from ..discrepancy import batch
from ..errors import InputError
from ..estimate import initial_guess, predict
from ..recording import Recording, save
from ..vehicle import read_vehicle
from . import session, terminal
from .output import refuse_existing
from .runs import load_run


def run(vehicle_path: Path, run_path: Path, out: Path, overwrite: bool, columns: Path | None = None) -> None:
    """Write the recording's inputs and the model's outputs to `out`.

    The model starts from the first measured samples where the recording has them, else at rest at operating speed. Of a
    log, the file at `columns` says what to take.
    """
    session.start()
    refuse_existing(out, overwrite)
    vehicle = read_vehicle(vehicle_path)
    recording = load_run(run_path, vehicle, columns)
    missing = {c: np.full(len(recording.times), np.nan) for c in vehicle.layout.channels if c not in recording.columns}
    given = Recording(recording.name, recording.times, recording.columns | missing, recording.source)
    with terminal.progress(f"simulating {vehicle.layout.name}"):
        runs = batch(vehicle, [given])
        start, _ = initial_guess(vehicle, runs)
        shown = np.asarray(predict(vehicle, runs, jnp.asarray(start)))[0]
    if not np.all(np.isfinite(shown)):
        raise InputError(str(vehicle_path), "the model diverges on these inputs", "check the coefficients' signs")
    layout = vehicle.layout
    answer = {name: recording.column(name) for name in (*layout.held, *layout.interpolated)}
    answer |= dict(zip(layout.channels, shown.T, strict=True))
    save(Recording(out.stem, recording.times, answer, str(out)), out)
