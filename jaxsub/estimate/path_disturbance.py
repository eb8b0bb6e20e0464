"""The disturbance force of a vehicle whose numbers are known, by the innovations along recordings."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..filter import state_scale
from ..likelihood import Disturbance, filter_runs
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from .disturbance import estimate_disturbance

# rounds in which it is estimated along the path that the last estimate led
_ROUNDS = 3
# sample intervals of the first guess of a time constant; the force is one that makes sigma of velocity in half of that
_SLOW = 20.0


def disturbance_along(
    vehicle: AbstractVehicle,
    runs: Runs,
    sigma: Float[Values, " c"],
    start: Float[Array, "r s"],
    start_std: Float[Array, " s"],
) -> Disturbance:
    """The Gauss–Markov forces and sensors' noise that make the innovations of `vehicle` along `runs` most probable.

    `vehicle` has no free numbers. `sigma` (c,) is the noise of its channels, in whose units that of the disturbance is.
    `start` (R, s) and `start_std` (s,) are means and standard deviations of the initial states. All are SI.
    """
    n, noise = len(vehicle.layout.equations), jnp.asarray(sigma)
    usual = float(np.median(np.asarray(runs.steps)[np.asarray(runs.step_of)]))
    inertia = np.diag(np.asarray(vehicle.mass_matrix()))
    force = inertia * np.asarray(state_scale(vehicle, np.asarray(sigma)))[:n] / (0.5 * _SLOW * usual)
    found = Disturbance(force, np.full(n, _SLOW * usual), np.ones(len(sigma)))
    for _ in range(_ROUNDS):
        followed = filter_runs(vehicle, runs, noise, found, start, start_std)
        found = estimate_disturbance(followed.system, followed.residual, np.zeros((1, 1)), found)
        found = jax.tree.map(np.asarray, found)
    return found
