"""What this library is timed at: a cost with its derivatives, at one point or at many, and a sweep of starts."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import Problem, gauss_newton, scattered

from .case import Case
from .timing import once

# of a sweep: starts, how far they scatter, and how far above the least cost an end has reached it
COUNT, SPREAD, SEED = 1000, 0.5, 5
_MARGIN = 0.1


@eqx.filter_jit
def cost(problem: Problem, z: jax.Array) -> jax.Array:
    """The cost at one point (d,) or at several (N, d)."""
    return problem.cost(z) if z.ndim == 1 else jax.vmap(problem.cost)(z)


@eqx.filter_jit
def with_gradient(problem: Problem, z: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The cost and its gradient, by reverse mode."""
    of = jax.value_and_grad(problem.cost)
    return of(z) if z.ndim == 1 else jax.vmap(of)(z)


@eqx.filter_jit
def forward_jacobian(problem: Problem, z: jax.Array) -> jax.Array:
    """Whitened errors by the coefficients alone, columns first."""
    p = len(problem.prior_mean)
    tangents = jnp.eye(p, z.shape[0])
    return jax.vmap(lambda tangent: jax.jvp(problem.residuals, (z,), (tangent,))[1])(tangents)


@eqx.filter_jit
def expansion(problem: Problem, z: jax.Array):
    """All that a Gauss-Newton step takes: cost, gradient and curvature by coefficients and initial states."""
    return problem.expand(z) if z.ndim == 1 else jax.vmap(problem.expand)(z)


def points(case: Case, count: int) -> np.ndarray:
    """(N, d) coordinates about the start of the search."""
    return 0.01 * np.random.default_rng(1).standard_normal((count, case.size))


def starts_of(problem: Problem, count: int) -> np.ndarray:
    """(N, d) starts of a sweep."""
    return np.asarray(scattered(problem, SPREAD, count, SEED))


def swept(problem: Problem, starts: np.ndarray) -> dict:
    """A search from each of the starts, and what it takes to compile it, on as many starts that end at once."""
    search = lambda chosen: gauss_newton().run(problem, jnp.asarray(chosen))
    _, compiling = once(lambda: search(np.full_like(starts, np.nan)))
    found, seconds = once(lambda: search(starts))
    return {
        "starts": len(starts),
        "compile_s": compiling,
        "seconds": seconds,
        "cost": np.asarray(found.cost),
        "evaluations_median": float(np.median(np.asarray(found.evaluations))),
    }


def ended(row: dict, best: float) -> dict:
    """A sweep's row with its seconds a start and, for the costs, the share at the `best` and how many were lost."""
    cost = row["cost"]
    return {name: value for name, value in row.items() if name != "cost"} | {
        "seconds_a_start": row["seconds"] / row["starts"],
        "reached": float(np.mean(cost < best + _MARGIN)),
        "lost": int(np.sum(~np.isfinite(cost))),
    }
