"""Initial states of runs: at rest, or from the first samples, with how far they may be from there."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..effects import CHANNEL_UNITS
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle, Layout
from ..vehicle.attitude import EULER, QUATERNION, quaternion_of
from ..vehicle.base import memory_states

# how far an initial state that nothing measures may lie from rest: m/s, rad/s, rad, m
_SPREAD = {"m/s": 1.0, "rad/s": 0.5, "rad": 0.5, "m": 10.0}
# of what an effect remembers, which starts at zero
_MEMORY = 0.1


def initial_guess(vehicle: AbstractVehicle, runs: Runs) -> tuple[Float[Array, "r s"], Float[Array, " s"]]:
    """Initial states (R, s) of `runs` of `vehicle`, and their standard deviations (s,), SI.

    They are from the first sample of each state's channel, else at rest. A run's deviation of a number that differs by
    run has the standard deviation between runs, and none while that is not known.

    A sensor that starts late measures a state that may have changed since the run began: the standard deviation is then
    at least the rms change of its channel over so long a time.
    """
    layout, measured = vehicle.layout, state_channels(vehicle.layout)
    kept = memory_states(vehicle.effects)
    mask, outputs, times = np.asarray(runs.mask), _as_states(vehicle, runs), np.asarray(runs.times)
    guess = np.tile(_resting(vehicle), (len(times), 1))
    start_std = np.ones(len(layout.states))
    deviations = layout.deviations
    for i, name in enumerate(layout.states):
        if name in deviations:
            start_std[i] = np.nan_to_num(np.asarray(vehicle.spreads[deviations[name].name]))
            continue
        start_std[i] = _MEMORY if name in kept else _SPREAD.get(CHANNEL_UNITS.get(name, ""), 1.0)
        if name not in measured:
            if (coordinate := name.removesuffix("_rate")) in layout.channels:
                start_std[i] = max(start_std[i], _fastest(runs, layout.channels.index(coordinate)))
            continue
        column = layout.channels.index(measured[name])
        # wide enough that the prior weighs nothing against the channel's own first samples
        start_std[i] = max(start_std[i], _std(outputs[..., column][mask[..., column]]))
        for run, there in enumerate(mask[..., column]):
            if there.any():
                guess[run, i] = outputs[run, there, column][0]
                start_std[i] = max(start_std[i], _change(times[run, there], outputs[run, there, column]))
    if QUATERNION[0] in layout.states:
        rows = [layout.states.index(name) for name in QUATERNION]
        for run in range(len(guess)):
            guess[run, rows] = quaternion_of(_first_angles(layout, mask[run], outputs[run]))
        start_std[rows] = 0.5 * _SPREAD["rad"]
    return tuple(jax.device_put((guess, start_std)))


def rest(vehicle: AbstractVehicle, count: int) -> Float[Array, "r s"]:
    """`count` initial states (R, s) of `vehicle`, SI: at the origin and at rest, a body at its operating speed."""
    return jnp.asarray(np.tile(_resting(vehicle), (count, 1)))


def _resting(vehicle: AbstractVehicle) -> Float[np.ndarray, " s"]:
    layout = vehicle.layout
    surges = layout.kind == "submerged-body" and "u" in layout.states
    speed = float(vehicle.own_values()["speed"]) if surges else 0.0
    return np.array([speed if surges and name == "u" else 0.0 for name in layout.states])


def state_channels(layout: Layout) -> dict[str, str]:
    """By state of `layout` the output that measures it, where there is one; the state itself before other forms."""
    among = {name: [o for o in layout.outputs if o.state == name] for name in layout.states}
    # false comes before true
    other = lambda output: output.channel != output.name
    return {name: min(outputs, key=other).name for name, outputs in among.items() if outputs}


def _as_states(vehicle: AbstractVehicle, runs: Runs) -> Float[np.ndarray, "r k c"]:
    """The outputs in the form of the states that they measure, by the sensors' present numbers."""
    sensors, columns = jax.tree.map(np.asarray, vehicle.sensors), np.asarray(runs.outputs)
    return np.stack([sensors.channel_of(o, columns[..., i]) for i, o in enumerate(vehicle.layout.outputs)], axis=-1)


def _first_angles(layout: Layout, mask: Bool[np.ndarray, "k c"], outputs: Float[np.ndarray, "k c"]) -> list[float]:
    """The first samples of roll, pitch and heading (rad) of a run, zero of an angle that nothing measures."""
    angles = dict.fromkeys(EULER, 0.0)
    for column, output in enumerate(layout.outputs):
        if output.state in angles and mask[:, column].any():
            angles[output.state] = float(outputs[mask[:, column], column][0])
    return list(angles.values())


def _fastest(runs: Runs, column: int) -> float:
    """The largest rate of a channel between two samples that follow each other."""
    steps, mask = np.asarray(runs.steps)[np.asarray(runs.step_of)], np.asarray(runs.mask)[..., column]
    there = np.asarray(runs.live) & mask[:, 1:] & mask[:, :-1]
    change = np.diff(np.asarray(runs.outputs)[..., column])
    return float(np.max(np.abs(change[there]) / steps[there], initial=0.0))


def _change(times: Float[np.ndarray, " n"], values: Float[np.ndarray, " n"]) -> float:
    """The rms change of a signal over as long a time as passes from 0 s to its first sample.

    Where it was measured for less than twice that time, in proportion from the change over half of what there is.
    """
    if len(times) < 2 or times[0] == 0.0:
        return 0.0
    over = min(times[0], 0.5 * (times[-1] - times[0]))
    begins = times[times <= times[-1] - over]
    change = np.interp(begins + over, times, values) - values[: len(begins)]
    return float(np.sqrt(np.mean(change**2)) * times[0] / over)


def _std(samples: np.ndarray) -> float:
    return float(np.std(samples)) if len(samples) else 0.0
