"""Searches within bounds: where a step of a value leads, and the optimum that SciPy's bounded solver finds."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from scipy.optimize import least_squares

from jaxsub.estimate.damped import Damped
from jaxsub.estimate.problem import Expansion
from jaxsub.parameters import Parameter, Transform

ROWS = [
    Parameter("free"),
    Parameter("above", lower=0.5),
    Parameter("below", upper=-0.2),
    Parameter("within", lower=-3.0, upper=1.0),
]
START = np.array([2.0, 1.5, -1.0, -0.5])


@pytest.mark.parametrize("far", [-9.0, 0.0, 3.0])
@pytest.mark.parametrize("size", [-50.0, -0.3, 1e-6, 0.4, 200.0])
def test_a_step_is_one_of_the_value_and_stops_before_a_bound(far, size):
    """Claim: the value moves by slope times step; where that leaves the bounds, by nine tenths of the way there."""
    transform = Transform.of(ROWS, START)
    y = jnp.full(4, far)
    theta, slope = jax.jvp(transform.to_physical, (y,), (jnp.ones(4),))
    wanted = np.asarray(theta + slope * size)
    low, high = (np.array([getattr(row, side) for row in ROWS]) for side in ("lower", "upper"))
    nearest = np.where(wanted > theta, theta + 0.9 * (high - theta), theta - 0.9 * (theta - low))
    expected = np.where(wanted > theta, np.minimum(wanted, nearest), np.maximum(wanted, nearest))
    there, part = transform.stepped(y, jnp.full(4, size))
    np.testing.assert_allclose(transform.to_physical(there), expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(slope * part, expected - np.asarray(theta), rtol=1e-6, atol=1e-12)


def curve(theta, data):
    """A decay and an offset that trade with each other, and a product that bends."""
    t = np.linspace(0.0, 4.0, 40)
    at = jnp if isinstance(theta, jax.Array) else np
    return theta[0] + theta[1] * at.exp(theta[2] * t) + 0.3 * theta[3] * theta[1] * t - data


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("edge", [0, 9])
def test_the_search_ends_where_scipys_bounded_one_does(seed, edge):
    """Claim: whichever bounds are met, and though it begins at them, no cost is more than 1e-4 above SciPy's."""
    rng = np.random.default_rng(seed)
    data = curve(START + rng.normal(0.0, 1.0, 4), 0.0) + 0.02 * rng.standard_normal(40)
    transform = Transform.of(ROWS, START)
    cost = lambda y: 0.5 * jnp.sum((curve(transform.to_physical(y), data) / 0.02) ** 2)

    def expand(args, y):
        J = jax.jacfwd(lambda y: curve(transform.to_physical(y), data) / 0.02)(y)
        return Expansion(cost(y), jax.grad(cost)(y), J.T @ J)

    solver = Damped(expand, 1e-5, within=lambda args: transform.stepped)
    begin = transform.to_free(jnp.asarray(START)) + jnp.asarray(edge * rng.choice([-1.0, 1.0], 4) * [0, 1, 1, 1])
    found = optx.minimise(lambda y, _: cost(y), solver, begin, max_steps=200, throw=False)
    bounds = [row.lower for row in ROWS], [row.upper for row in ROWS]
    tries = [
        least_squares(lambda th: curve(th, data) / 0.02, start, bounds=bounds, x_scale="jac", ftol=1e-14, xtol=1e-14)
        for start in (START, np.asarray(transform.to_physical(found.value)))
    ]
    assert float(cost(found.value)) <= min(one.cost for one in tries) + 1e-4
    assert found.result == optx.RESULTS.successful
    assert int(found.stats["num_steps"]) < 80
