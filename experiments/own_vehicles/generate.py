"""Files that conceal a case's effect, and, apart from them, what is true."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from experiments.concealed_physics.generate import nearly, write
from experiments.concealed_physics.simulate import Drive, outputs
from jaxsub.parameters import Parameter
from jaxsub.vehicle import AbstractVehicle
from jaxsub.vehicle.coefficient_units import coefficient_unit

from .plan import CASES, Case
from .vehicles import TRIALS


def generate(case: Case, folder: Path) -> dict:
    """Write `vehicle.toml` and `run1.csv` … of `case`; returns the truth, which no file holds.

    The last run is the one to hold out. Numbers of the file that are free are off by 10 to 20 %, but for those that the
    case is about, which are the catalogue's.
    """
    trial, rng = TRIALS[case.vehicle], np.random.default_rng([CASES.index(case), 11])
    known = trial.make()
    own = {name: known.values()[name] for name in (*case.factors, *case.drifts)}
    true = [known.with_values(_true(case, own, run)) for run in range(trial.runs)]
    starts = np.stack([trial.start(vehicle, rng) for vehicle in true])
    held = np.stack([trial.drive(run, trial.samples, rng) for run in range(trial.runs)])
    moved = np.stack([trial.prescribed(commands) for commands in held])
    calm = np.zeros((trial.runs, trial.samples, len(known.layout.equations)))
    truths, sizes = ((case.truth[0],), jnp.asarray([case.truth[1]])) if case.truth else ((), jnp.zeros(0))
    arrays = map(jnp.asarray, (starts, held[:, :-1], calm, moved))
    drive = Drive(*arrays, interval=trial.interval)
    alone = [outputs(vehicle, truths, sizes, drive.of(slice(run, run + 1))) for run, vehicle in enumerate(true)]
    ideal, states = (np.concatenate(parts) for parts in zip(*alone, strict=True))
    if not np.all(np.isfinite(ideal)):
        raise FloatingPointError(f"{case.name}: the vehicle diverges")
    sigma = np.array([output.sigma for output in known.layout.outputs])
    measured = ideal + sigma * rng.standard_normal(ideal.shape)
    file = nearly(case.file(_freed(known, tuple(own))), sigma.tolist(), rng)
    write(folder, file.with_values(own), measured, held, states, case.recorded(moved), trial.interval)
    floor = np.sqrt(np.mean(((measured - ideal)[-1] / sigma) ** 2, axis=0))
    return {
        "names": [truth.name for truth in truths],
        "where": [list(truth.where) for truth in truths],
        "sizes": sizes.tolist(),
        "values": {name: float(true[-1].values()[name]) for name in case.factors},
        "floor": dict(zip(known.layout.channels, floor.tolist(), strict=True)),
    }


def _true(case: Case, own: Mapping[str, Any], run: int) -> dict[str, Any]:
    """What the case's numbers are in a run, of their values in the file."""
    factors = {name: own[name] * factor for name, factor in case.factors.items()}
    return factors | {name: own[name] + added[run] for name, added in case.drifts.items()}


def _freed(vehicle: AbstractVehicle, names: tuple[str, ...]) -> AbstractVehicle:
    """The vehicle with those numbers free too, also those of `[body]` that the catalogue gives no more than a value."""
    rows = {row.name: row for row in vehicle.layout.parameters}
    rows |= {name: Parameter(name, coefficient_unit(name)) for name in names if name not in rows}
    free = tuple(dataclasses.replace(row, free=row.free or name in names) for name, row in rows.items())
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=free))
