"""What this library is timed at: the cost of a fit with its derivatives, at one point or at many."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.estimate import Problem

from .case import Case


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
