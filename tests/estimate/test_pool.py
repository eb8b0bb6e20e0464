"""A pool of lanes ends every search where it would end alone, however many lanes there are and whichever fail."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from rigs import oscillator, recorded

from jaxsub.estimate import Problem, gauss_newton, scattered
from jaxsub.estimate.pool import pool
from jaxsub.results import RESULTS


def valley(y, scale):
    """Rosenbrock's function; `scale` makes one problem differ from the next."""
    value = scale * (y[1] - y[0] ** 2) ** 2 + (1.0 - y[0]) ** 2
    return jnp.where(y[0] < -2.5, jnp.nan, value)


STARTS = np.random.default_rng(5).uniform(-2.0, 2.0, (13, 2))
SCALES = np.linspace(1.0, 40.0, 13)


def through(lanes, starts=STARTS, max_steps=200):
    solver = optx.BFGS(rtol=1e-8, atol=1e-8)
    of = lambda index: jnp.asarray(SCALES)[index]
    run = jax.jit(lambda y: pool(solver, valley, y, of, lanes=lanes, max_steps=max_steps))
    return run(jnp.asarray(starts))


@pytest.mark.parametrize("lanes", [1, 4, 13, 50])
def test_every_end_is_that_of_the_search_alone(lanes):
    ends = through(lanes)
    solver = optx.BFGS(rtol=1e-8, atol=1e-8)
    for start, scale, y, steps, good in zip(
        STARTS, SCALES, ends.y, ends.steps, np.asarray(ends.result == RESULTS.successful), strict=True
    ):
        alone = optx.minimise(valley, solver, jnp.asarray(start), scale, max_steps=200)
        assert good
        assert steps == alone.stats["num_steps"]
        np.testing.assert_allclose(y, alone.value, rtol=1e-10)


def test_searches_that_fail_are_values_and_leave_the_others_alone():
    starts = STARTS.copy()
    starts[4] = [-3.0, 0.0]
    ends, clean = through(3, starts), through(3)
    good = np.asarray(ends.result == RESULTS.successful)
    assert np.flatnonzero(~good).tolist() == [4]
    np.testing.assert_allclose(ends.y[good], clean.y[good], rtol=1e-12)


def test_search_that_takes_too_many_steps_says_so():
    ends = through(4, max_steps=5)
    assert np.asarray(ends.result == RESULTS.nonlinear_max_steps_reached).all()
    assert (np.asarray(ends.steps) == 5).all()


def test_recordings_of_their_own_give_each_search_its_own_optimum():
    runs = recorded(oscillator(), 1, 40, 0.2, 3, amplitude=1.0)
    problem = Problem.of(oscillator(), runs, jnp.array([0.01, 0.02]))
    draws = np.random.default_rng(1).standard_normal((5, *runs.outputs.shape)) * [0.01, 0.02]
    starts = scattered(problem, 0.3, 5, seed=2)
    together = gauss_newton().run(problem, starts, runs.outputs + draws)
    for index in range(5):
        alone = gauss_newton().run(problem, starts[:1], (runs.outputs + draws[index])[None])
        np.testing.assert_allclose(together.y[index], alone.y[0], atol=1e-3)
        np.testing.assert_allclose(together.cost[index], alone.cost[0], rtol=1e-6)
    assert np.std(together.cost) > 1.0


AT_ONCE = """
from concurrent.futures import ThreadPoolExecutor
import jax, jax.numpy as jnp, optimistix as optx
from jaxsub.estimate.curvature import Arrow
from jaxsub.estimate.damped import Damped
from jaxsub.estimate.problem import Expansion
jax.config.update("jax_enable_x64", True)
mixed = 0.3 * jnp.sin(jnp.arange(9 * 64.0)).reshape(9, 8, 8) + jnp.eye(8)

def cost(y):
    own = jnp.concatenate([jnp.broadcast_to(y[:4], (9, 4)), y[4:].reshape(9, 4)], axis=1)
    return jnp.sum(jnp.cosh(jnp.einsum("rij,rj->ri", mixed, own)))

def parts(whole):
    among, across, rest = whole[:4, :4], whole[:4, 4:], whole[4:, 4:].reshape(9, 4, 9, 4)
    return Arrow(among, across.reshape(4, 9, 4).swapaxes(0, 1), rest[jnp.arange(9), :, jnp.arange(9)])

expand = lambda _, y: Expansion(cost(y), jax.grad(cost)(y), {curvature}(jax.hessian(cost)(y)))
search = lambda y: optx.minimise(lambda y, _: cost(y), Damped(expand, 1e-9), y, max_steps=50, throw=False).value
program = jax.jit(jax.vmap(search)).lower(jnp.ones((32, 40))).compile()
starts = [jnp.linspace(-1.0, 1.0, 32 * 40).reshape(32, 40) + 0.01 * share for share in range(8)]
with ThreadPoolExecutor(2) as threads:
    ends = list(threads.map(lambda y: jax.block_until_ready(program(y)), starts))
assert max(float(jnp.max(jnp.abs(end))) for end in ends) < 1e-3
"""


@pytest.mark.parametrize("curvature", ["parts", pytest.param("jnp.asarray", marks=pytest.mark.long)])
def test_two_programs_of_searches_at_a_time_end(curvature):
    """Claim: a thread for each core, each in a batch of searches, and none waits for the other without end."""
    subprocess.run([sys.executable, "-c", AT_ONCE.replace("{curvature}", curvature)], check=True, timeout=300)
