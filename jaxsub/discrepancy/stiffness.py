r"""Integration steps short enough for the forces of effects: what decays within a part of a step is not followed.

Linear damping is exact at any step. What effects add is stepped explicitly, and from $|\lambda|h \approx 2.8$ on a
fourth-order Runge–Kutta step grows where the motion decays. Source: Hairer and Wanner (1996), Solving Ordinary
Differential Equations II, ch. IV.2.
"""

import dataclasses

import jax
import numpy as np

from ..effects import AbstractForce, AbstractMemory, Motion
from ..estimate import Fit
from ..vehicle import AbstractVehicle

FINEST = 16  # steps in a sample interval
# of a step times the fastest rate: beyond the one it is not followed, and with the other it is
_TOO_MUCH, _FOLLOWED = 2.5, 1.5
# of a velocity's rms, for differences
_SMALL = 1e-4


def fastest(vehicle: AbstractVehicle, motion: Motion) -> float:
    """The largest rate (1/s) at which the forces of effects without states answer velocities along a `motion`."""
    effects = [e for e in vehicle.effects if isinstance(e, AbstractForce) and not isinstance(e, AbstractMemory)]
    if not effects:
        return 0.0
    effects, equations = jax.tree.map(np.asarray, effects), vehicle.layout.equations
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
    return float(np.max(np.abs(np.linalg.eigvals(np.linalg.solve(np.asarray(vehicle.mass_matrix()), slopes)))))


def substeps_for(fit: Fit, motion: Motion) -> int:
    """Integration steps in a sample interval of a fit's runs, as they are or as many as its effects need."""
    turned = float(np.max(np.asarray(fit.runs.steps))) * fastest(fit.vehicle, motion)
    if not turned > _TOO_MUCH * fit.runs.substeps:
        return fit.runs.substeps
    return substeps_of(turned, fit.runs.substeps)


def substeps_of(turned: float, least: int = 1) -> int:
    """Steps in an interval that is `turned` times the fastest rate long."""
    return int(np.clip(np.ceil(turned / _FOLLOWED), least, FINEST))
