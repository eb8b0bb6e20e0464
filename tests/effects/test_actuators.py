"""A lag is the exact exponential and a delay the exact shift of a held command; both are smooth in their time."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from samples import BODY
from scipy.integrate import solve_ivp

from jaxsub.effects import ActuatorDelay, ActuatorLag

rng = np.random.default_rng(5)
TIMES = np.concatenate([[3.0], 3.0 + np.cumsum(rng.uniform(0.05, 0.4, 25))])
COMMAND = rng.normal(size=25)
NODES = jnp.asarray(np.repeat(COMMAND[:, None], 3, 1))


def test_lag_is_the_solution_of_its_equation():
    T, state = 0.27, COMMAND[0]
    found = ActuatorLag("rudder", jnp.asarray(T)).respond(jnp.asarray(TIMES), NODES)
    for k, (begin, end) in enumerate(pairwise(TIMES)):
        rate = lambda t, d, k=k: (COMMAND[k] - d) / T
        middle = 0.5 * (begin + end)
        path = solve_ivp(rate, (begin, end), [state], t_eval=[begin, middle, end], rtol=1e-11, atol=1e-12).y[0]
        np.testing.assert_allclose(found[k], path, atol=1e-9)
        state = path[-1]


@pytest.mark.parametrize(
    "effect", [ActuatorLag("rudder", jnp.asarray(1e-7)), ActuatorDelay("rudder", jnp.asarray(0.0))]
)
def test_no_time_at_all_leaves_the_command(effect):
    found = effect.respond(jnp.asarray(TIMES), NODES)
    np.testing.assert_allclose(found[:, 1:], NODES[:, 1:], atol=1e-9)


def test_delay_of_whole_samples_is_a_shift():
    times = 0.1 * np.arange(26)
    found = ActuatorDelay("rudder", jnp.asarray(0.3)).respond(jnp.asarray(times), NODES)
    expected = np.concatenate([np.repeat(COMMAND[0], 3), COMMAND[:-3]])
    np.testing.assert_allclose(found, np.repeat(expected[:, None], 3, 1), atol=1e-12)


def test_delay_is_the_mean_of_the_shifted_command_over_each_interval():
    tau = 0.37
    found = ActuatorDelay("rudder", jnp.asarray(tau)).respond(jnp.asarray(TIMES), NODES)[:, 0]
    fine = lambda k: np.linspace(TIMES[k], TIMES[k + 1], 20001)[:-1] + (TIMES[k + 1] - TIMES[k]) / 40000 - tau
    command = lambda t: COMMAND[np.clip(np.searchsorted(TIMES, t, side="right") - 1, 0, 24)]
    np.testing.assert_allclose(found, [command(fine(k)).mean() for k in range(25)], atol=1e-3)


def test_delay_keeps_the_impulse_of_a_command_that_ends_at_zero():
    quiet = NODES.at[:3].set(0.0).at[-6:].set(0.0)
    found = ActuatorDelay("rudder", jnp.asarray(0.37)).respond(jnp.asarray(TIMES), quiet)
    dt = np.diff(TIMES)
    np.testing.assert_allclose(found[:, 0] @ dt, quiet[:, 0] @ dt, rtol=1e-12)


@pytest.mark.parametrize(("kind", "field"), [(ActuatorLag, "T"), (ActuatorDelay, "tau")])
def test_candidates_lie_near_any_time_from_half_a_sample_to_32(kind, field):
    """Claim: the nearest is never off by more than a factor of √2: a fit from a far one ends in another valley."""
    tried = [float(getattr(effect, field)) for effect in kind.candidates(BODY) if effect.actuator == "rudder"]
    for time in BODY.sample_interval * np.geomspace(0.5, 32.0, 30):
        assert min(abs(np.log(time / other)) for other in tried) <= 0.5 * np.log(2.0) + 1e-9, time


@pytest.mark.parametrize("time", [1e-9, 1e-5, 1e-3, 0.05, 0.333, 5.0])
@pytest.mark.parametrize("kind", [ActuatorLag, ActuatorDelay])
def test_derivative_in_the_time_is_finite_and_is_the_difference_quotient(kind, time):
    answer = jax.jit(lambda value: kind("rudder", value).respond(jnp.asarray(TIMES), NODES))
    slope = jax.jvp(answer, (jnp.asarray(time),), (jnp.asarray(1.0),))[1]
    assert np.isfinite(slope).all()
    if time >= 0.05:
        h = 1e-6
        quotient = (answer(time + h) - answer(time - h)) / (2.0 * h)
        np.testing.assert_allclose(slope, quotient, atol=1e-5 * np.abs(quotient).max())
