r"""What a disturbance makes of a simulation, which no measurement corrects but for its initial state.

With $z = [x, d]$ of a linearised model, $z_{k+1} = F_k z_k + B_k w_k$ from $x_0 = 0$: what random $w$ show in the
channels, less what an initial state takes up of it by least squares.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..programs import compiled
from .disturbance import Disturbance, System, transition
from .sensitivity import propagate


def open_loop_errors(
    disturbance: Disturbance, system: System, draws: Float[Values, "r k n m"]
) -> Float[np.ndarray, "r k c m"]:
    """Errors of m simulations of each run, in units of the channels' noise, which is not in them.

    `draws` are standard normal numbers for the n forces of `disturbance` at each sample of the runs of `system`.
    Initial states are those of least squares. Zero where nothing was measured, infinite where a simulation diverges.
    """
    pushed, begun = (np.asarray(part) for part in _responses(disturbance, system, draws))
    left = np.empty_like(pushed)
    for run, (error, columns) in enumerate(zip(pushed, begun, strict=True)):
        flat, columns = error.reshape(-1, error.shape[-1]), columns.reshape(-1, columns.shape[-1])
        finite = np.isfinite(flat).all() and np.isfinite(columns).all()
        left[run] = (flat - columns @ np.linalg.lstsq(columns, flat)[0]).reshape(error.shape) if finite else np.inf
    return left


@compiled
def _responses(
    disturbance: Disturbance, system: System, draws: Float[Values, "r k n m"]
) -> tuple[Float[Array, "r k c m"], Float[Array, "r k c s"]]:
    """What the channels show of random forces and of each initial state."""
    states = system.A.shape[-1]
    F, B = transition(disturbance, system)
    first = disturbance.force[:, None] * draws[:, 0]
    begin = jnp.concatenate([jnp.zeros((len(first), states, first.shape[-1]), first.dtype), first], axis=1)
    moved = propagate(F, B @ draws[:, 1:], begin)
    nothing = jnp.zeros((*system.A.shape[:-1], states), first.dtype)
    begun = propagate(system.A, nothing, jnp.broadcast_to(jnp.eye(states), (len(first), states, states)))
    return system.C @ moved[:, :, :states], system.C @ begun
