"""What a vehicle does along given states, as NumPy arrays: what effects are evaluated on."""

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from ..effects import AbstractForce, AbstractMemory, Motion
from ..programs import compiled
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle


class Trajectory(eqx.Module):
    """The filtered trajectory as NumPy arrays: what effects are evaluated on.

    NumPy on purpose: a force is a handful of array operations, so a vocabulary of any size costs no compilation.

    **Fields**

    - `start`, `end`: at both ends of every interval, (R, K-1): filtered, and what was expected from there.
    - `seen`: at every sample, (R, K), as expected; `true`: (R, K) measured channels there, SI, without sensor effects.
    - `nodes`: (R, K-1, 3, m) signals after the actuators, SI, time last.
    - `times`: (R, K) s; `steps`: (R, K-1) s, 0 where padded.
    """

    start: Motion
    end: Motion
    seen: Motion
    true: dict[str, np.ndarray]
    nodes: np.ndarray
    times: np.ndarray
    steps: np.ndarray

    @classmethod
    def of(cls, vehicle: AbstractVehicle, runs: Runs, expected: Array, filtered: Array) -> "Trajectory":
        """The motion of `vehicle` over `runs` along states (R, K, s) `expected` and `filtered`, SI."""
        found = _trajectory(_without_forces(vehicle), runs, expected, filtered)
        steps = np.where(runs.live, np.asarray(runs.steps)[np.asarray(runs.step_of)], 0.0)
        return cls(*(jax.tree.map(np.asarray, part) for part in (*found, runs.times, steps)))


def _without_forces(vehicle: AbstractVehicle) -> AbstractVehicle:
    """A vehicle that moves alike along given states: what forces its effects add makes no other program."""
    for effect in vehicle.effects:
        if isinstance(effect, AbstractForce) and not isinstance(effect, AbstractMemory):
            vehicle = vehicle.without_effect(effect.label)
    return vehicle


@compiled
def _trajectory(vehicle: AbstractVehicle, runs: Runs, expected: Array, filtered: Array) -> tuple:
    nodes = jax.vmap(vehicle.actuate)(runs.times, runs.nodes())
    start = vehicle.motion(filtered[:, :-1], nodes[:, :, 0])
    end = vehicle.motion(expected[:, 1:], nodes[:, :, 2])
    true, seen = vehicle.truth(runs.times, expected, runs.signals)
    return start, end, seen, true, nodes
