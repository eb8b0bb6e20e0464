r"""What a disturbance makes of a simulation, which no measurement corrects: the spread of its error.

With $z = [x, d]$, $z_{k+1} = F_k z_k + B_k w_k$ and an initial state that is known, $P_0 = \mathrm{diag}(0, q^2)$ and
$P_{k+1} = F_k P_k F_k^T + B_k B_k^T$. Source: Gelb (1974), Applied Optimal Estimation, ch. 3.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..programs import compiled
from .disturbance import Disturbance, System, transition


@compiled
def open_loop_variance(disturbance: Disturbance, system: System) -> Float[Array, "r k c"]:
    r"""$\mathrm{diag}\,C_k P_k C_k^T$, (R, K, c): variance of each channel, in units of its noise squared.

    Of a simulation of `system` (states s, equations n) whose model is right, under the forces of `disturbance`; the
    channels' noise is not in it. Zero where nothing was measured.
    """
    states = system.A.shape[-1]
    shown = lambda C, P: jnp.einsum("cs,st,ct->c", C, P[:states, :states], C)
    begin = jnp.diag(jnp.concatenate([jnp.zeros(states), disturbance.force]) ** 2)

    def run(F: Array, B: Array, C: Array) -> Array:
        def step(P: Array, at: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            F, B, C = at
            after = F @ P @ F.T + B @ B.T
            return after, shown(C, after)

        later = jax.lax.scan(step, begin, (F, B, C[1:]))[1]
        return jnp.concatenate([shown(C[0], begin)[None], later])

    return jax.vmap(run)(*transition(disturbance, system), system.C)
