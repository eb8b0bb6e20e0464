"""Recordings as the batch that a vehicle takes."""

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from ..estimate import initial_guess
from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..vehicle import AbstractVehicle
from .stiffness import substeps_free, substeps_of, substeps_unseen


def batch(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Runs:
    """The recordings as the batch that `vehicle` takes, with as many integration steps a sample as it needs."""
    layout = vehicle.layout
    rates = np.linalg.solve(np.asarray(vehicle.mass_matrix()), np.asarray(vehicle.damping_matrix()))
    fastest = float(np.max(np.abs(np.linalg.eigvals(rates))))
    longest = max(float(np.diff(r.times).max()) for r in recordings)
    # linear damping is exact at any step; effects that replace it have the same rate and are not
    substeps = substeps_of(longest * fastest)
    runs = stack_runs(
        recordings, held=layout.held, interpolated=layout.interpolated, channels=layout.channels, substeps=substeps
    )
    runs = dataclasses.replace(runs, substeps=substeps_free(vehicle, runs))
    # what noise hides is told where the file says how large that is
    sigma = jnp.array([output.sigma or np.inf for output in layout.outputs])
    unseen = substeps_unseen(vehicle, runs, initial_guess(vehicle, runs)[0], sigma)
    return dataclasses.replace(runs, substeps=unseen)
