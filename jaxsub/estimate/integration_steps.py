r"""Integration steps short enough for the forces of effects: what decays within a part of a step is not followed.

Linear damping is exact at any step. What effects and the vehicle's products of velocities add is stepped explicitly,
and from $|\lambda|h \approx 2.8$ on a fourth-order Runge–Kutta step grows where the motion decays. Source: Hairer and
Wanner (1996), Solving Ordinary Differential Equations II, ch. IV.2.

A step that does not grow may still be too long, of a roll or a hysteresis that turns within a sample: half as long ones
show by how much.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..arrays import Values
from ..effects import AbstractForce, AbstractMemory, Motion
from ..likelihood import concentrated_sigma
from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import Trajectory, sampled_states, simulate
from ..vehicle import AbstractVehicle
from .initial_states import initial_guess

FINEST = 16  # steps in a sample interval
# of a step times the fastest rate: beyond the one it is not followed, and with the other it is
_TOO_MUCH, _FOLLOWED = 2.5, 1.5
# of a channel's noise, what steps half as long may change
_UNSEEN = 0.05
# of a velocity's rms, for differences
_SMALL = 1e-4


def fastest(vehicle: AbstractVehicle, motion: Motion) -> float:
    """The largest rate (1/s) at which the forces of effects without states answer velocities along a `motion`."""
    effects, equations = jax.tree.map(np.asarray, _at_once(vehicle)), vehicle.layout.equations
    if not effects:
        return 0.0
    still = np.zeros(np.shape(motion.rates[equations[0]]))

    def force(at: Motion) -> np.ndarray:
        parts = [effect.force(at) for effect in effects]
        return np.stack([sum((np.asarray(part.get(e, 0.0)) for part in parts), still) for e in equations], axis=-1)

    def slope(equation: str) -> np.ndarray:
        rate = np.asarray(motion.rates[equation])
        small = _SMALL * max(float(np.sqrt(np.mean(rate**2))), _SMALL)
        moved = lambda by: dataclasses.replace(motion, rates=motion.rates | {equation: rate + by})
        return (force(moved(small)) - force(moved(-small))) / (2.0 * small)

    slopes = np.stack([slope(e) for e in equations], axis=-1)
    inertia = jax.tree.map(np.asarray, vehicle).mass_matrix()
    return float(np.max(np.abs(np.linalg.eigvals(np.linalg.solve(inertia, slopes)))))


def substeps_for(vehicle: AbstractVehicle, runs: Runs, motion: Motion, most: float = _TOO_MUCH) -> int:
    """Integration steps in a sample interval of `runs`, as they are or as many as effects need along a `motion`.

    The effects are those of `vehicle`. Steps stay while one is no longer than `most` over the fastest rate.
    """
    turned = float(np.max(np.asarray(runs.steps))) * fastest(vehicle, motion)
    return substeps_of(turned, runs.substeps) if turned > most * runs.substeps else runs.substeps


def substeps_free(vehicle: AbstractVehicle, runs: Runs) -> int:
    """The same in simulation from the file's numbers, and as many as an error far below the file's noise needs.

    A channel without a noise in the file needs none.
    """
    runs = dataclasses.replace(runs, substeps=_followed_free(vehicle, runs))
    sigma = np.array([output.sigma or np.inf for output in vehicle.layout.outputs])
    # recordings of about the same length share a program
    runs = runs.padded()
    return substeps_unseen(vehicle, runs, initial_guess(vehicle, runs)[0], sigma)


def _followed_free(vehicle: AbstractVehicle, runs: Runs) -> int:
    """As many as forces without states need; as `runs` are, where the vehicle diverges however fine its steps.

    What is stepped too coarsely moves too slowly, or diverges: steps are shortened until they are as short as asked.
    """
    if not _at_once(vehicle):
        return runs.substeps
    start, tried, most = initial_guess(vehicle, runs)[0], runs, _TOO_MUCH
    while tried.substeps <= FINEST:
        states = sampled_states(vehicle, tried, start)
        asked = 2 * tried.substeps
        if np.all(np.isfinite(states)):
            asked = substeps_for(vehicle, tried, Trajectory.of(vehicle, tried, states, states).start, most)
        if asked == tried.substeps:
            return asked
        tried, most = dataclasses.replace(tried, substeps=asked), _FOLLOWED
    return runs.substeps


def substeps_unseen(vehicle: AbstractVehicle, runs: Runs, start: Array, sigma: Values) -> int:
    """Steps in a sample interval of which half as long ones change no channel by much of its noise `sigma` (c,), rms.

    `vehicle` is simulated along `runs` from the initial states `start` (R, s), SI. As `runs` are where it diverges
    however fine its steps. Source: Hairer, Nørsett and Wanner (1993), Solving Ordinary Differential Equations I, ch.
    II.4 (step doubling).
    """
    steps, finite = runs.substeps, True
    while steps < FINEST:
        changed, finite = _halved(vehicle, dataclasses.replace(runs, substeps=steps), start)
        if np.all(np.asarray(changed) <= _UNSEEN * np.asarray(sigma)):
            return steps
        steps *= 2
    return steps if finite else runs.substeps


@compiled
def _halved(vehicle: AbstractVehicle, runs: Runs, start: Array) -> tuple[Float[Array, " c"], Bool[Array, ""]]:
    """What half as long steps change of each channel, rms, SI, and whether what they show is finite."""
    finer = simulate(vehicle, dataclasses.replace(runs, substeps=2 * runs.substeps), start)
    off = jnp.where(runs.mask, finer - simulate(vehicle, runs, start), 0.0)
    return concentrated_sigma(off, runs), jnp.all(jnp.isfinite(finer))


def substeps_of(turned: float, least: int = 1) -> int:
    """Steps in an interval that is `turned` times the fastest rate long."""
    return int(np.clip(np.ceil(turned / _FOLLOWED), least, FINEST))


def _at_once(vehicle: AbstractVehicle) -> list[Any]:
    """What is stepped explicitly: forces of effects without states, and of the vehicle's own products."""
    effects = [e for e in vehicle.effects if isinstance(e, AbstractForce) and not isinstance(e, AbstractMemory)]
    return [*effects, *vehicle.nonlinear]
