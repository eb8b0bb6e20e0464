"""Files that conceal a case's effect, and, apart from them, what is true."""

import dataclasses
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.concealed_physics.generate import nearly, write
from experiments.concealed_physics.simulate import Drive, outputs
from jaxsub.vehicle import AbstractVehicle

from .plan import CASES, Case
from .vehicles import TRIALS

RUNS = 3


def generate(case: Case, folder: Path) -> dict:
    """Write `vehicle.toml` and `run1.csv` … of `case`; returns the truth, which no file holds.

    The last run is the one to hold out. Numbers of the file that are free are off by 10 to 20 %, but for those that the
    case is about, which are the catalogue's.
    """
    trial, rng = TRIALS[case.vehicle], np.random.default_rng([CASES.index(case), 11])
    known = trial.make()
    values = {name: known.values()[name] * factor for name, factor in case.factors.items()}
    true = known.with_values(values)
    starts = np.stack([trial.start(true, rng) for _ in range(RUNS)])
    held = np.stack([trial.drive(run, trial.samples, rng) for run in range(RUNS)])
    calm = np.zeros((RUNS, trial.samples, len(true.layout.equations)))
    truths, sizes = ((case.truth[0],), jnp.asarray([case.truth[1]])) if case.truth else ((), jnp.zeros(0))
    drive = Drive(*(jnp.asarray(a) for a in (starts, held[:, :-1], calm)))
    ideal, states = (np.asarray(a) for a in outputs(true, truths, sizes, drive))
    if not np.all(np.isfinite(ideal)):
        raise FloatingPointError(f"{case.name}: the vehicle diverges")
    sigma = np.array([output.sigma for output in true.layout.outputs])
    measured = ideal + sigma * rng.standard_normal(ideal.shape)
    file = nearly(case.file(_freed(known, tuple(values))), sigma.tolist(), rng)
    write(folder, file.with_values({name: known.values()[name] for name in values}), measured, held, states)
    floor = np.sqrt(np.mean(((measured - ideal)[-1] / sigma) ** 2, axis=0))
    return {
        "names": [truth.name for truth in truths],
        "where": [list(truth.where) for truth in truths],
        "sizes": sizes.tolist(),
        "values": {name: float(value) for name, value in values.items()},
        "floor": dict(zip(true.layout.channels, floor.tolist(), strict=True)),
    }


def _freed(vehicle: AbstractVehicle, names: tuple[str, ...]) -> AbstractVehicle:
    """The vehicle with those numbers free too."""
    rows = (dataclasses.replace(row, free=row.free or row.name in names) for row in vehicle.layout.parameters)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=tuple(rows)))
