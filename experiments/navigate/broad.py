"""BROAD: a hand-held board against an optical reference, by the data set's own errors.

The sensor file is of the class of the board's sensors, in round numbers, and one for all trials. It states neither the
magnetometer's delay nor anything else that was found on these trials.
"""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from jaxsub.recording import Recording

from ..fuzzy_filter.broad import (
    INTERVAL,
    Prepared,
    Settings,
    Trial,
    follow,
    prepared,
    rmse,
    to_enu,
    trials,
)
from .command import columns, navigated

SENSORS = """
schema = 1
name = "BROAD"
[motion]
reach = 0.5                          # m: a board in a hand
reach_time = 1.0                     # s
[sensors.gyro]
column = ["gx", "gy", "gz"]
grade = "consumer"
sampling = "mean"                    # of a digital sensor, which filters what it samples
[sensors.accelerometer]
column = ["ax", "ay", "az"]
grade = "consumer"
sampling = "mean"
[sensors.magnetometer]
column = ["mx", "my", "mz"]
unit = "uT"
correlation = 1.0                    # s from one place in the room to another
delay = "estimate"
calibration = "soft-iron"
"""


def quaternions(run: Recording) -> np.ndarray:
    """(K, 4) body to ENU, of the angles of a recording."""
    angles = np.stack([run.column(name) for name in ("psi", "theta", "phi")], axis=1)
    return to_enu(Rotation.from_euler("ZYX", angles).as_quat(scalar_first=True))


@jax.jit
def _followed(start: Prepared) -> jax.Array:
    """Attitudes by the filter as `experiments.fuzzy_filter` uses it in Python, the magnetometer's delay given to it."""
    return follow("constant", Settings(), start)[0]


def _library(trial: Trial) -> dict[str, float]:
    q = _followed(jax.tree.map(jnp.asarray, prepared(trial, len(trial.times))))
    return rmse(trial, to_enu(np.asarray(q)))


def _scored(trial: Trial, out: Path) -> dict:
    """Errors of ours in degrees, and what the command says of the magnetometer."""
    parts = columns("g", trial.gyro) | columns("a", trial.accelerometer) | columns("m", trial.magnetometer)
    written = navigated(Recording(trial.name, trial.times, parts, trial.name), SENSORS, out)
    methods = {"filter": rmse(trial, quaternions(written.filtered))}
    methods |= {"smoother": rmse(trial, quaternions(written.smoothed)), "library": _library(trial)}
    return {
        "rmse_deg": methods,
        "magnetometer": written.content["magnetometer"],
        "seconds": written.seconds,
        "duration": len(trial.times) * INTERVAL,
    }


def run(out: Path, quick: bool) -> dict:
    """Errors by trial of the command and of the library; `quick` takes one trial."""
    return {"trials": {trial.name: _scored(trial, out / "broad") for trial in trials()[: 1 if quick else None]}}
