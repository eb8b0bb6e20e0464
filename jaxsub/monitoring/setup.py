"""A monitor of a vehicle: its filter's disturbance estimated on clean runs, or left at what the sensors' noise says."""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..errors import InputError
from ..estimate import batch, disturbance_along, initial_guess
from ..filter import DisturbedProcess, InnovationGate, VehicleProcess, disturbed_filter, state_scale
from ..filter.defaults import DENSITY
from ..likelihood import Disturbance
from ..navigation import Stream
from ..recording import Recording
from ..simulation import sampled_states, synthetic
from ..vehicle import AbstractVehicle
from .lines import row_columns
from .monitor import AlarmTest, Monitor
from .signatures import windows_for

# of the motion that a monitor without clean runs is calibrated along, samples
_ALONG = 512
# times the usual interval, of a gap across which the model is not asked to lead
_GAP = 20.0
# s below the threshold after which an alarm has ended
QUIET = 60.0
# s of the longest window in which a change is looked for
LONGEST = 3600.0


class WatchedModel(NamedTuple):
    """What a monitor's filter assumes of a vehicle whose numbers are known.

    **Fields**

    - `vehicle`: without free numbers. `sigma`: (c,) noise of its channels, SI. `substeps`: in a sample interval.
    - `disturbance`: of its forces. `density`: (s,) root of the white noise of its states, per root second.
    - `start_std`: (s,) of an initial state, SI. `interval`: s, usual between samples.
    - `longest`: s, of the longest window in which a change is looked for.
    """

    vehicle: AbstractVehicle
    sigma: np.ndarray
    substeps: int
    disturbance: Disturbance
    density: np.ndarray
    start_std: np.ndarray
    interval: float
    longest: float = LONGEST


def model_of(vehicle: AbstractVehicle, clean: Sequence[Recording]) -> WatchedModel:
    """The model of `vehicle` with the disturbance that makes the `clean` runs most probable.

    **Raises** `InputError` for outputs without sigma, and for runs along which the filter diverges.
    """
    known, sigma = _known(vehicle)
    runs = batch(known, clean)
    start, start_std = initial_guess(known, runs)
    disturbance = disturbance_along(known, runs, sigma, start, start_std)
    if not all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(disturbance)):
        raise InputError("clean runs", "the vehicle's filter diverges along them", "identify the vehicle first")
    interval = float(np.median(np.concatenate([np.diff(run.times) for run in clean])))
    quiet = np.zeros(len(known.layout.states))
    return WatchedModel(known, sigma, runs.substeps, disturbance, quiet, np.asarray(start_std), interval)


def model_by_noise(vehicle: AbstractVehicle, interval: float) -> tuple[WatchedModel, list[Recording]]:
    """The model of `vehicle` whose states stray as `filter.vehicle_filter` lets them; and a run of it at rest.

    `interval` is the usual time between samples, s. **Raises** `InputError` for outputs without sigma.
    """
    known, sigma = _known(vehicle)
    layout = known.layout
    times = interval * np.arange(_ALONG)
    columns = dict.fromkeys((*layout.held, *layout.interpolated), np.zeros(_ALONG))
    runs = synthetic(
        known, [Recording("rest", times, columns, f"{layout.name} at rest")], seed=0, states=sampled_states
    )
    stacked = batch(known, runs)
    n, c = len(layout.equations), len(sigma)
    moving = np.array([name not in layout.deviations for name in layout.states])
    density = DENSITY * np.asarray(state_scale(known, jnp.asarray(sigma))) * moving
    still = Disturbance(np.zeros(n), np.ones(n), np.ones(c))
    start_std = np.asarray(initial_guess(known, stacked)[1])
    return WatchedModel(known, sigma, stacked.substeps, still, density, start_std, interval), runs


def monitor_of(model: WatchedModel, quiet: float = QUIET) -> Monitor:
    """The monitor of a `model`, not calibrated yet: its threshold is infinite.

    An alarm has ended after `quiet` s below the threshold.
    """
    layout, d = model.vehicle.layout, model.disturbance
    n, c = len(layout.equations), len(model.sigma)
    process = DisturbedProcess(
        VehicleProcess.of(model.vehicle, model.substeps), jnp.asarray(d.force), jnp.asarray(d.time)
    )
    sigma, start_std, density = (
        jnp.asarray(values) for values in (model.sigma * np.asarray(d.noise), model.start_std, model.density)
    )
    filter = disturbed_filter(process, sigma, start_std, density, InnovationGate.of(c))
    windows = windows_for(model.longest / model.interval)
    test = AlarmTest(jnp.asarray(jnp.inf), jnp.ones((windows, n + c)), jnp.asarray(float(quiet)))
    held = (True,) * len(layout.held) + (False,) * len(layout.interpolated)
    return Monitor(Stream(filter, longest=_GAP * model.interval), jnp.asarray(model.sigma), test, held)


def rows_of(vehicle: AbstractVehicle, recordings: Sequence[Recording], gap: float = 0.0) -> Float[np.ndarray, "k w"]:
    """Times, signals and outputs (1 + m + c) of `vehicle`, SI, of all `recordings`, each `gap` s after the last."""
    layout, found, end = vehicle.layout, [], 0.0
    for recording in recordings:
        columns = [recording.column(name) for name in row_columns(layout)]
        found.append(np.column_stack([recording.times - recording.times[0] + end, *columns]))
        end = found[-1][-1, 0] + gap
    return np.concatenate(found)


def initial_state(model: WatchedModel, rows: Float[np.ndarray, "k w"]) -> Float[Array, " s"]:
    """The state (s,) of the vehicle of `model`, SI, that the first of `rows` (K, w) show, else at rest."""
    layout = model.vehicle.layout
    names = row_columns(layout)
    rows = rows[np.isfinite(rows[:, 0])]
    # two samples at least make a recording
    times = rows[0, 0] + model.interval * np.arange(max(2, len(rows)))
    table = np.resize(np.where(np.isinf(rows), np.nan, rows), (len(times), rows.shape[1]))
    held = range(1, 1 + len(layout.held) + len(layout.interpolated))
    table[:, held] = np.nan_to_num(table[:, held])
    columns = {name: table[:, 1 + i] for i, name in enumerate(names)}
    recording = Recording("first samples", times, columns, "first samples")
    return jnp.asarray(initial_guess(model.vehicle, batch(model.vehicle, [recording]))[0][0])


def _known(vehicle: AbstractVehicle) -> tuple[AbstractVehicle, Float[np.ndarray, " c"]]:
    """The vehicle without free numbers, and the noise of its channels."""
    for output in vehicle.layout.outputs:
        if output.sigma is None:
            where = f"{vehicle.layout.name}, output {output.name}"
            raise InputError(where, "its sigma is to be estimated", "give sigma; jaxsub identify estimates it")
    return vehicle.holding(vehicle.values()), np.array([output.sigma for output in vehicle.layout.outputs], float)
