"""The disturbance of largest restricted likelihood."""

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Float

from ..likelihood import Columns, Disturbance, System, restricted

# from nothing known, and from a disturbance that is near: a step more would gain less than the likelihood is read to
FROM_AFAR, FROM_NEAR = 25, 10
# standard deviations of weak priors on the logarithms of q, τ and κ: without them an absent force has no optimum
_LOOSE = (5.0, 1.5, 2.0)
# as well as some minutes of a force tell log q and log τ; the search is in such units
_TOLD = (0.1, 0.2)


@eqx.filter_jit
def estimate_disturbance(
    system: System, columns: Columns, prior: Float[Array, "p1 p1"], start: Disturbance, steps: int
) -> Disturbance:
    """The disturbance of largest restricted likelihood, to a part of a natural unit, within so many `steps` of `start`.

    The first of the `columns` is the residual; `prior` as for `restricted`.
    """
    n, c = len(start.force), len(start.noise)
    by_part = lambda force, time, noise: jnp.concatenate([jnp.full(n, force), jnp.full(n, time), jnp.full(c, noise)])
    samples = jnp.maximum(jnp.sum(system.measured), 1)
    unit = by_part(*_TOLD, jnp.sqrt(c / (2.0 * samples)))
    centre = jnp.log(jnp.concatenate([start.force, start.time, start.noise]))
    loose = by_part(*_LOOSE)
    parts = lambda y: Disturbance(*jnp.split(jnp.exp(centre + unit * y), [n, 2 * n]))

    def cost(y: Array, given: tuple[System, Columns, Array]) -> Array:
        return restricted(parts(y), *given) + 0.5 * jnp.sum((unit * y / loose) ** 2)

    solver, given = optx.BFGS(rtol=1e-4, atol=0.1), (system, columns, prior)
    return parts(optx.minimise(cost, solver, jnp.zeros(2 * n + c), given, max_steps=steps, throw=False).value)
