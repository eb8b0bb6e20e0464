"""Recordings as a fitted vehicle would have made them, for sweeps that draw the noise anew."""

from collections.abc import Sequence

import numpy as np

from ..errors import InputError
from ..estimate import batch, search
from ..recording import Recording
from ..simulation import simulate
from ..vehicle import AbstractVehicle


def answered(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> list[Recording]:
    """`recordings` with every measured sample replaced by the answer, without noise, of `vehicle` fitted to them.

    With seeds of noise on top this is the parametric bootstrap (Efron and Tibshirani 1993, section 6.5): how estimates
    would scatter, were the same runs recorded again. A sample that is missing stays so.

    **Raises** `InputError` where the model does not run from the file's values.
    """
    runs = batch(vehicle, recordings)
    found = search(vehicle, runs)
    if not np.isfinite(float(found.cost)):
        what = "the model does not run from these values on " + ", ".join(r.name for r in recordings)
        raise InputError(vehicle.layout.name, what, "give values that are closer")
    shown, made = np.asarray(simulate(found.vehicle, runs, found.start)), []
    for recording, answer in zip(recordings, shown, strict=True):
        columns = dict(recording.columns)
        for column, values in zip(vehicle.layout.columns, answer.T, strict=True):
            missing = np.isnan(recording.column(column))
            columns[column] = np.where(missing, np.nan, values[: len(missing)])
        made.append(Recording(recording.name, recording.times, columns, f"{recording.source} (answered)"))
    return made
