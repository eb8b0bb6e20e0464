"""The interior point ends where the conditions of an optimum hold, with limits that hold and limits that yield."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

from jaxsub.control.quadratic import Quadratic, quadratic_minimum


def problem(seed, d=6, hard=10, soft=8):
    """A random program that the origin is inside the hard limits of, and outside some that yield."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((d, d))
    return Quadratic(
        jnp.asarray(root @ root.T + 0.1 * np.eye(d)),
        jnp.asarray(5.0 * rng.standard_normal(d)),
        jnp.asarray(rng.standard_normal((hard + soft, d))),
        jnp.asarray(np.concatenate([-rng.uniform(0.1, 1.0, hard), rng.standard_normal(soft)])),
        jnp.asarray(np.concatenate([np.zeros(hard), np.full(soft, 1e-3)])),
    )


SOLVE = jax.jit(quadratic_minimum)


@pytest.mark.parametrize("seed", range(5))
def test_minimum_keeps_the_conditions_of_karush_kuhn_and_tucker(seed):
    p = problem(seed)
    d, multipliers = SOLVE(p)
    slack = p.w * multipliers - (p.G @ d + p.g)
    np.testing.assert_allclose(p.H @ d + p.q + p.G.T @ multipliers, 0.0, atol=1e-6)
    assert float(jnp.min(multipliers)) >= 0.0
    assert float(jnp.min(slack)) > -1e-7
    assert float(jnp.max(jnp.abs(slack * multipliers))) < 1e-6
    assert int(jnp.sum(multipliers > 1e-4)) > 0


@pytest.mark.parametrize("seed", range(3))
def test_minimum_is_the_one_that_scipy_finds(seed):
    p = problem(seed)
    hard = np.asarray(p.w) == 0.0

    def cost(d):
        past = np.maximum(np.asarray(p.G @ d + p.g), 0.0)[~hard]
        return float(0.5 * d @ p.H @ d + p.q @ d) + 0.5 * np.sum(past**2) / 1e-3

    inside = {"type": "ineq", "fun": lambda d: -np.asarray(p.G @ d + p.g)[hard]}
    best = minimize(cost, np.zeros(6), constraints=[inside], method="SLSQP", options={"ftol": 1e-13, "maxiter": 500})
    assert cost(np.asarray(SOLVE(p)[0])) == pytest.approx(best.fun, rel=1e-6)


def test_without_limits_it_is_a_linear_system():
    p = problem(1)
    free = Quadratic(p.H, p.q, jnp.zeros((0, 6)), jnp.zeros(0), jnp.zeros(0))
    np.testing.assert_allclose(quadratic_minimum(free)[0], -np.linalg.solve(p.H, p.q), rtol=1e-6)
