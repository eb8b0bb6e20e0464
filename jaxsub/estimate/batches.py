"""Recordings as the batch that a vehicle takes."""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..vehicle import AbstractVehicle, check_units
from .integration_steps import substeps_free, substeps_of


def batch(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Runs:
    """The recordings as the batch that `vehicle` takes, with as many integration steps a sample as it needs."""
    runs = side_by_side(vehicle, recordings)
    return dataclasses.replace(runs, substeps=substeps_free(vehicle, runs))


def side_by_side(vehicle: AbstractVehicle, recordings: Sequence[Recording]) -> Runs:
    """`recordings` of `vehicle` as `batch` stacks them, with no more steps than linear damping needs.

    It is for a model whose steps are known.
    """
    layout = vehicle.layout
    check_units(layout, recordings)
    plain = jax.tree.map(np.asarray, vehicle)
    rates = np.linalg.solve(plain.mass_matrix(), plain.damping_matrix())
    fastest = float(np.max(np.abs(np.linalg.eigvals(rates))))
    longest = max(float(np.diff(r.times).max()) for r in recordings)
    # linear damping is exact at any step; effects that replace it have the same rate and are not
    columns = {"held": layout.held, "interpolated": layout.interpolated, "channels": layout.columns}
    return stack_runs(recordings, **columns, angles=layout.angles, substeps=substeps_of(longest * fastest))
