"""Simulations that start anew in each of several pieces of a run, from what a filter knows there."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...likelihood import FilteredRuns
from ...recording.runs import Runs
from ...simulation import simulate
from ...vehicle import AbstractVehicle


def restarted(vehicle: AbstractVehicle, followed: FilteredRuns, runs: Runs, pieces: int) -> Float[Array, "r k c"]:
    """Outputs (SI) of simulations through `pieces` of each run, each from the filtered state at its first sample."""
    cut, first = runs.segments(pieces), starts(followed, pieces)
    shown = simulate(vehicle, cut, first).reshape(len(runs.times), pieces, *cut.outputs.shape[1:])
    inner = shown[:, :, :-1].reshape(len(runs.times), -1, shown.shape[-1])
    return jnp.concatenate([inner, shown[:, -1, -1:]], axis=1)[:, : runs.times.shape[1]]


def starts(followed: FilteredRuns, pieces: int) -> Float[Array, "rp s"]:
    """The filtered states where the pieces of runs begin, as `Runs.segments` lists them."""
    samples = followed.filtered.shape[1]
    length = -(-(samples - 1) // pieces)
    first = np.minimum(length * np.arange(pieces), samples - 1)
    return followed.filtered[:, first].reshape(-1, followed.filtered.shape[-1])
