"""How a simulation starts: at rest, from the first samples, or from the most probable initial state."""

import dataclasses
from typing import Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..estimate import initial_guess, rest, search, state_channels
from ..estimate.between_runs import unknown_spreads
from ..findings import Finding
from ..recording import Recording
from ..recording.runs import Runs
from ..results import RESULTS
from ..vehicle import AbstractVehicle

Start = Literal["rest", "recorded", "estimated"]


def with_every_channel(recording: Recording, vehicle: AbstractVehicle) -> Recording:
    """The recording with the columns of the vehicle's outputs that it lacks as columns of missing samples.

    **Raises** `InputError` for a channel that it has and that cannot be used.
    """
    measured = vehicle.layout.columns
    absent = [c for c in measured if c not in recording.columns and c not in recording.unusable]
    table = {c: recording.column(c) for c in measured if c not in absent}
    nothing = np.full(len(recording.times), np.nan)
    columns = recording.columns | table | dict.fromkeys(absent, nothing)
    return dataclasses.replace(recording, columns=columns)


def initial_state(
    vehicle: AbstractVehicle, runs: Runs, recording: Recording, start: Start
) -> tuple[Start, Float[Array, " s"], list[Finding]]:
    """How the one run starts, its initial state in SI units, and what is to be said of it.

    Where nothing is measured the model starts at rest. **Raises** `InputError` for a recorded start of which a sensor's
    first sample is later than the longest interval between its samples, or an estimated one with which it diverges.
    """
    began, state, findings = _initial_state(vehicle, runs, recording, start)
    unknown = unknown_spreads(vehicle)
    if not unknown:
        return began, state, findings
    what = f"how much {', '.join(unknown)} differs between runs is not known; the run has the mean"
    remedy = "take the vehicle from `jaxsub identify`, or give spread = … beside varies"
    return began, state, [*findings, Finding("initial-state", "note", recording.source, what, remedy)]


def _initial_state(
    vehicle: AbstractVehicle, runs: Runs, recording: Recording, start: Start
) -> tuple[Start, Float[Array, " s"], list[Finding]]:
    where = recording.source
    if start != "rest" and not np.any(np.asarray(runs.mask)):
        what = f"has no sample of {', '.join(vehicle.layout.channels)}; the model starts at rest"
        return "rest", rest(vehicle, 1)[0], [Finding("initial-state", "note", where, what)]
    if start == "rest":
        return start, rest(vehicle, 1)[0], []
    if start == "recorded":
        _require_prompt(vehicle, runs, where)
        return start, initial_guess(vehicle, runs)[0][0], []
    found = search(vehicle, runs, moving=False)
    if not bool(jnp.isfinite(found.cost)):
        raise InputError(where, "the model diverges from every initial state tried", "check the coefficients' signs")
    if found.converged:
        return start, found.start[0], []
    what = f"the search for the initial state did not converge: {RESULTS[found.result]}"
    return start, found.start[0], [Finding("initial-state", "warning", where, what, "try --start recorded")]


def _require_prompt(vehicle: AbstractVehicle, runs: Runs, where: str) -> None:
    for channel in state_channels(vehicle.layout).values():
        times = np.asarray(runs.times)[0, np.asarray(runs.mask)[0, :, vehicle.layout.channels.index(channel)]]
        longest = np.max(np.diff(times), initial=0.0)
        if len(times) and times[0] > longest:
            what = f"{channel} has its first sample at {times[0]:.4g} s, later than its longest gap, {longest:.4g} s"
            raise InputError(where, what, "give --start estimated, or cut the run there")
