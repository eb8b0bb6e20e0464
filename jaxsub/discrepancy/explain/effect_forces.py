r"""The force of the effects that were added to a model: as modelled, and as the recordings show it.

The recordings' is what the baseline needs, with the force it lacks, less what the improved model has besides effects:
$M(\dot\nu_0 + M_0^{-1}\tau_0) - (M\dot\nu - \tau_e)$, with $\dot\nu$ the accelerations of a model along its filtered
trajectory, $\tau_0$ the baseline's smoothed missing force and $\tau_e$ the force of the effects. It may differ from
$\tau_e$: no estimate of the improved model's missing force is in it, which would be small by assumption.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...effects import AbstractEffect, AbstractForce
from ...programs import compiled
from ...vehicle import AbstractVehicle
from ..linearise.columns import differences
from ..linearise.view import View, missing_force

# (R, K-1, n) N or N m at the start of every interval of the runs
Forces = Float[np.ndarray, "r k1 n"]


def effect_forces(baseline: View, improved: View, added: Sequence[AbstractEffect]) -> tuple[Forces, Forces] | None:
    """The force of the effects `added` to the `baseline` by the recordings, and as modelled; None where none is one."""
    labels = {effect.label for effect in added}
    # as the view's vehicle has them: their numbers are those of its filtered trajectory
    acting = [one for one in improved.vehicle.effects if one.label in labels and isinstance(one, AbstractForce)]
    if not acting:
        return None
    modelled = np.sum([whole[0] for whole in differences(improved, acting)], axis=0)
    mass, mass_before = (np.asarray(view.vehicle.mass_matrix()) for view in (improved, baseline))
    lacking = missing_force(baseline)[0][:, :-1]
    needed = accelerations(baseline) + np.linalg.solve(mass_before, lacking[..., None])[..., 0]
    return (needed - accelerations(improved)) @ mass.T + modelled, modelled


def accelerations(view: View) -> Float[np.ndarray, "r k1 n"]:
    """Accelerations (m/s², rad/s²) of a model at the start of every interval, without the force that it lacks."""
    return np.asarray(
        _accelerations(view.vehicle, view.followed.filtered[:, :-1], jnp.asarray(view.path.nodes[:, :, 0]))
    )


@compiled
def _accelerations(vehicle: AbstractVehicle, states: Array, signals: Array) -> Array:
    return vehicle.acceleration(states, signals)
