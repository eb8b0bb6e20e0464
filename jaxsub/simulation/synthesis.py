"""Recordings that a vehicle would have made: of the same type as loaded ones, with a truth that is known."""

from collections.abc import Callable, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import VELOCITIES
from ..errors import InputError
from ..recording import Recording
from ..recording.runs import Runs, stack_runs
from ..vehicle import AbstractVehicle, recorded_columns
from .continuous import integrate
from .sampled import measure

States = Callable[[AbstractVehicle, Runs, Array], Array]


def at_rest(vehicle: AbstractVehicle, count: int) -> Float[Array, "r s"]:
    """`count` initial states (R, s) of `vehicle`, SI: at rest at the origin, a body at its operating speed."""
    layout = vehicle.layout
    ahead = [vehicle.speed if _is_surge(vehicle, e) else 0.0 for e in layout.equations]
    return jnp.tile(jnp.asarray(ahead + [0.0] * len(layout.positions)), (count, 1))


def synthetic(
    vehicle: AbstractVehicle,
    recordings: Sequence[Recording],
    *,
    seed: int,
    start: Float[Array, "r s"] | None = None,
    noise: bool = True,
    states: States = integrate,
) -> list[Recording]:
    """What `vehicle` would have recorded at the times of `recordings`, driven by their inputs.

    Each holds the input columns of its recording and a column for each output, SI, with white Gaussian noise of its
    sigma (none where that is to be estimated, or without `noise`). A channel recorded in an
    input column, such as a prescribed pitch, stays as it is. `start` is the initial state of each run, `at_rest` by
    default; `states` is `integrate` or `sampled_states`. The noise of run i depends on `seed` and i alone.

    **Raises** `InputError` for an input column that is absent or has a gap, and for a run that diverges.
    """
    layout = vehicle.layout
    columns = layout.held + layout.interpolated
    driven = [_without_outputs(recording, columns, layout.columns) for recording in recordings]
    runs = stack_runs(
        driven,
        held=layout.held,
        interpolated=layout.interpolated,
        channels=layout.columns,
        angles=layout.angles,
    )
    start = at_rest(vehicle, len(driven)) if start is None else start
    shown = np.asarray(measure(vehicle, runs, states(vehicle, runs, start)))
    sigma = np.array([(output.sigma or 0.0) * noise for output in layout.outputs])
    made = []
    for index, recording in enumerate(driven):
        outputs = shown[index, : len(recording.times)]
        _require_finite(recording, outputs)
        draws = np.random.default_rng([seed, index]).standard_normal(outputs.shape)
        measured = recorded_columns(layout.outputs, outputs + sigma * draws)
        inputs = {name: recording.column(name) for name in columns}
        made.append(Recording(recording.name, recording.times, measured | inputs, f"{recording.source} (synthetic)"))
    return made


def _is_surge(vehicle: AbstractVehicle, equation: str) -> bool:
    return vehicle.layout.kind == "submerged-body" and VELOCITIES[equation] == "u"


def _without_outputs(recording: Recording, inputs: tuple[str, ...], channels: tuple[str, ...]) -> Recording:
    columns = dict.fromkeys(channels, np.full_like(recording.times, np.nan))
    columns |= {name: recording.column(name) for name in inputs}
    return Recording(recording.name, recording.times, columns, recording.source, recording.first_row)


def _require_finite(recording: Recording, outputs: np.ndarray) -> None:
    wild = ~np.isfinite(outputs).all(axis=1)
    if wild.any():
        what = f"the vehicle's answer diverges by {recording.times[int(np.argmax(wild))]:g} s"
        raise InputError(recording.source, what, "check the signs of its coefficients, or cut the run short")
