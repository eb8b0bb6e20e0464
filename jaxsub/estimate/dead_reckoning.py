"""Motion models of dead reckoning: a vehicle's dynamics or its kinematics alone, filtered and smoothed along runs."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..errors import InputError
from ..filter import (
    AbstractFilter,
    ConstantNoise,
    DisturbedProcess,
    Estimate,
    ExtendedKalmanFilter,
    KinematicProcess,
    Sample,
    Smoothed,
    VehicleProcess,
    disturbed_filter,
    last,
    samples,
    smooth_block,
    state_scale,
)
from ..filter.defaults import DENSITY
from ..programs import compiled
from ..recording import Recording
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .batches import batch
from .fitting import channel_noise
from .initial_states import initial_guess
from .path_disturbance import disturbance_along

# s over which velocities change by more than the sensors' noise, to see how fast they stray
_STRAY = 1.0


class Outage(NamedTuple):
    """Channels that are missing from `begin` to `end`, s of the recording's clock."""

    channels: tuple[str, ...]
    begin: float
    end: float

    @classmethod
    def of(cls, text: str) -> "Outage":
        """Of `CHANNEL:FROM:TO`, or of several channels between commas. **Raises** `InputError` for other `text`."""
        names, *times = text.split(":")
        try:
            begin, end = map(float, times)
        except ValueError:
            begin = end = 0.0
        if not (names and begin < end):
            raise InputError(f"outage {text!r}", "is not CHANNEL:FROM:TO", "write one as u,v:60:120, times in s")
        return cls(tuple(names.split(",")), begin, end)

    def covers(self, run: Recording) -> Bool[np.ndarray, " k"]:
        """Which samples (K,) of `run` are in it."""
        return (run.times >= self.begin) & (run.times <= self.end)


class Track(NamedTuple):
    """Filtered and smoothed states (K, s) of a run with their standard deviations, SI.

    **Fields**

    - `innovations`: (K, c) in their standard deviations `innovation_std` (K, c), SI; NaN where missing.
    """

    filtered: np.ndarray
    filtered_std: np.ndarray
    smoothed: np.ndarray
    smoothed_std: np.ndarray
    innovations: np.ndarray
    innovation_std: np.ndarray


def _known(vehicle: AbstractVehicle, runs: Sequence[Recording]) -> tuple[AbstractVehicle, Runs]:
    """The vehicle without free numbers, and the runs stacked."""
    known = vehicle.holding(vehicle.values())
    return known, batch(known, runs).padded()


def model_filter(vehicle: AbstractVehicle, runs: Sequence[Recording]) -> AbstractFilter:
    """The filter of `vehicle` under the Gauss–Markov forces that make `runs` most probable."""
    known, stacked = _known(vehicle, runs)
    sigma = channel_noise(known, stacked)
    start, start_std = initial_guess(known, stacked)
    found = disturbance_along(known, stacked, sigma, start, start_std)
    process = DisturbedProcess(
        VehicleProcess.of(known, stacked.substeps), jnp.asarray(found.force), jnp.asarray(found.time)
    )
    return disturbed_filter(process, sigma * jnp.asarray(found.noise), jnp.asarray(start_std))


def kinematic_filter(vehicle: AbstractVehicle, runs: Sequence[Recording]) -> AbstractFilter:
    """The filter of the kinematics of `vehicle`, whose velocities stray as fast as those measured in `runs` change."""
    known, stacked = _known(vehicle, runs)
    sigma = channel_noise(known, stacked)
    scale = np.asarray(state_scale(known, np.asarray(sigma)))
    density, layout = DENSITY * scale, known.layout
    for i, state in enumerate(layout.states[: len(layout.equations)]):
        if state in layout.channels:
            column = layout.columns[layout.channels.index(state)]
            moved = [np.interp(run.times + _STRAY, run.times, v) - v for run, v in _seen(runs, column)]
            square = float(np.mean(np.concatenate(moved) ** 2)) if moved else 0.0
            density[i] = max(np.sqrt(max(square - 2.0 * scale[i] ** 2, 0.0) / _STRAY), density[i])
    density[len(layout.equations) :] = 0.0
    x_root = jnp.diag(jnp.asarray(initial_guess(known, stacked)[1]))
    return ExtendedKalmanFilter(
        KinematicProcess(known), ConstantNoise(jnp.diag(jnp.asarray(density))), jnp.diag(sigma), x_root
    )


def _seen(runs: Sequence[Recording], column: str) -> list[tuple[Recording, np.ndarray]]:
    """Each run and a column of it, where it was measured."""
    there = [(run, np.isfinite(run.column(column))) for run in runs]
    return [(run.select(own), run.column(column)[own]) for run, own in there if own.sum() > 1]


def tracks_of(
    vehicle: AbstractVehicle, filter: AbstractFilter, runs: Sequence[Recording], outages: Sequence[Outage]
) -> list[list[Track]]:
    """By `filter` the track of each of `runs` of `vehicle`, of all measurements, then without those of each outage.

    `outages` are taken one by one.

    **Raises** `InputError` where the filter diverges.
    """
    known, stacked = _known(vehicle, runs)
    length, layout = stacked.times.shape[1], known.layout
    mask = np.asarray(stacked.mask)
    masks = [mask]
    for outage in outages:
        own = mask.copy()
        for r, run in enumerate(runs):
            out = np.zeros(length, bool)
            out[: len(run.times)] = outage.covers(run)
            own[r][np.ix_(out, np.array([layout.channels.index(c) for c in outage.channels]))] = False
        masks.append(own)
    s, n = len(layout.states), len(filter.x_root) - len(layout.states)
    starts = jnp.pad(jnp.asarray(initial_guess(known, stacked)[0]), ((0, 0), (0, n)))
    # all at once: the runs with everything and with each outage are one batch
    of = samples(stacked)
    many = jax.tree.map(lambda leaf: jnp.tile(leaf, (len(masks), *[1] * (leaf.ndim - 1))), of)
    many = dataclasses.replace(many, mask=jnp.asarray(np.concatenate(masks)))
    seen, smooth, smooth_std = jax.tree.map(np.asarray, _smoothed(filter, many, jnp.tile(starts, (len(masks), 1))))
    if np.any(seen.diverged):
        raise InputError(layout.name, "its filter diverges along the runs", "identify the vehicle first")

    innovation_std = np.linalg.norm(seen.factor, axis=-1)
    white = np.where(seen.used, seen.innovation / innovation_std, np.nan)

    def track(i: int, run: Recording) -> Track:
        cut = lambda values: values[i, : len(run.times), :s]
        k = len(run.times)
        states = (cut(seen.x), cut(seen.x_std), cut(smooth), cut(smooth_std))
        return Track(*states, white[i, :k], innovation_std[i, :k])

    return [[track(m * len(runs) + r, run) for r, run in enumerate(runs)] for m in range(len(masks))]


@compiled
def _smoothed(
    filter: AbstractFilter, many: Sample, starts: Float[Array, "r n"]
) -> tuple[Estimate, Float[Array, "r k n"], Float[Array, "r k n"]]:
    """The estimates after each sample of R runs, and states given all samples with their standard deviations."""

    def shown(found: Smoothed, sample: Sample) -> tuple[Array, Array]:
        return found.x, jnp.sqrt(jnp.diag(found.covariance))

    def one(start: Array, sequence: Sample) -> tuple[Estimate, Array, Array]:
        begin = filter.start(start, jnp.zeros(0), jnp.zeros((0, 0)))
        state, estimates = jax.lax.scan(lambda state, sample: filter.step(state, sample), begin, sequence)
        x, std = smooth_block(filter, begin, sequence, last(filter, state), shown)[1]
        return estimates, x, std

    return jax.vmap(one)(starts, many)
