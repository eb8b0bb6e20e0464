"""What is said of the ends of many searches at once: how sure each estimate is, and whether it is one."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..programs import compiled
from ..results import RESULTS
from .damped import room_downhill
from .method import Found, in_shares, lanes_for, problems
from .optimum import inertia, inverse_information, judged, standard_errors_away
from .problem import Problem


class Ends(eqx.Module):
    """Where N searches ended, in physical units.

    **Fields**

    - `theta`, `standard_errors`: (N, p) the free parameters, SI, the initial states' uncertainty included.
    - `away`: (N,) how many standard errors the optimum may still be away. `result`: as `Solution` has it.
    """

    theta: Float[Array, "n p"]
    standard_errors: Float[Array, "n p"]
    away: Float[Array, " n"]
    result: RESULTS


def ends(problem: Problem, found: Found, outputs: Float[Array, "n r k c"] | None = None) -> Ends:
    """What `evaluate` says of a `Solution`, of every search on `problem` that `found` holds. Not to be called in `jit`.

    `outputs` (n, R, K, c), SI, are the measured outputs of each search, where each has its own.
    """
    theta, errors, away = in_shares(_evaluated, None, problem, found.y, outputs)
    return Ends(theta, errors, away, _judged(problem, theta, away, found.result))


@compiled
def _evaluated(_: None, problem: Problem, y: Float[Array, "n d"], outputs: Array | None) -> tuple[Array, Array, Array]:
    of, p = problems(problem, outputs), len(problem.prior_mean)

    def one(part: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        index, y = part
        at = of(index).expand(y)
        information = at.hessian
        room = room_downhill(problem.along, y, at.gradient)
        away = jnp.max(standard_errors_away(information, at.gradient, room)[:p], initial=0.0)
        theta, slope = jax.jvp(problem.transform.to_physical, (y[:p],), (jnp.ones(p),))
        errors = jnp.abs(slope) * jnp.sqrt(jnp.diag(inverse_information(information))[:p])
        return theta, errors, away

    return jax.lax.map(one, (jnp.arange(len(y)), y), batch_size=lanes_for(problem))


@compiled
def _judged(problem: Problem, theta: Float[Array, "n p"], away: Float[Array, " n"], result: RESULTS) -> RESULTS:
    one = lambda theta, away, result: judged(inertia(problem.vehicle_with(theta)), away, result)
    return jax.vmap(one)(theta, away, result)
