"""Limits of an actuator are those of its equation, stepped finely in NumPy: rate, stop, band, play, offset, stall."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.effects import (
    ActuatorBacklash,
    ActuatorDeadband,
    ActuatorMisalignment,
    ActuatorRateLimit,
    ActuatorSaturation,
    ControlSurfaceStall,
)

rng = np.random.default_rng(5)
TIMES = np.concatenate([[3.0], 3.0 + np.cumsum(rng.uniform(0.05, 0.4, 25))])
COMMAND = rng.normal(size=25)
NODES = jnp.asarray(np.repeat(COMMAND[:, None], 3, 1))
FINE = 4000


def ramp(R):
    """The deflection at FINE times in each interval, and at its end."""
    held, paths = COMMAND[0], []
    for k, (begin, end) in enumerate(pairwise(TIMES)):
        step, path = (end - begin) / FINE, np.empty(FINE)
        for i in range(FINE):
            held += np.clip(COMMAND[k] - held, -R * step, R * step)
            path[i] = held
        paths.append(path)
    return np.stack(paths)


def test_rate_limited_deflection_has_the_mean_and_slope_of_the_ramp_in_each_interval():
    found = np.asarray(ActuatorRateLimit("rudder", jnp.asarray(4.0)).respond(jnp.asarray(TIMES), NODES))
    path = ramp(4.0)
    s = (np.arange(FINE) + 0.5) / FINE - 0.5
    slope = path @ s / (s @ s)
    assert np.abs(slope).min() < 1e-6 < 0.05 < np.abs(slope).max()
    np.testing.assert_allclose(found[:, 1], path.mean(1), atol=1e-3)
    np.testing.assert_allclose(found[:, 2] - found[:, 0], slope, atol=2e-3)


@pytest.mark.parametrize(
    "effect",
    [
        ActuatorRateLimit("rudder", jnp.asarray(1e9)),
        ActuatorBacklash("rudder", jnp.asarray(0.0)),
        ActuatorSaturation("rudder", jnp.asarray(10.0)),
        ActuatorDeadband("rudder", jnp.asarray(0.0)),
    ],
    ids=lambda effect: effect.name,
)
def test_a_limit_that_is_never_reached_leaves_the_command(effect):
    np.testing.assert_allclose(effect.respond(jnp.asarray(TIMES), NODES), NODES, atol=1e-7)


def test_backlash_is_the_play_of_its_rule():
    held, expected, b = COMMAND[0], [], 0.4
    for command in COMMAND:
        held = command - b if held < command - b else command + b if held > command + b else held
        expected.append(held)
    found = ActuatorBacklash("rudder", jnp.asarray(b)).respond(jnp.asarray(TIMES), NODES)
    np.testing.assert_allclose(found, np.repeat(np.array(expected)[:, None], 3, 1), rtol=1e-14)
    assert np.sum(np.diff(expected) == 0.0) > 2


def test_curves_without_memory_are_their_formulas():
    answer = lambda kind, value: np.asarray(kind("rudder", jnp.asarray(value)).respond(jnp.asarray(TIMES), NODES))[:, 1]
    np.testing.assert_allclose(answer(ActuatorSaturation, 0.5), [min(max(c, -0.5), 0.5) for c in COMMAND])
    banded = [0.0 if abs(c) < 0.3 else c - 0.3 if c > 0.0 else c + 0.3 for c in COMMAND]
    np.testing.assert_allclose(answer(ActuatorDeadband, 0.3), banded, atol=1e-15)
    np.testing.assert_allclose(answer(ActuatorMisalignment, -0.02), COMMAND - 0.02)
    np.testing.assert_allclose(answer(ControlSurfaceStall, 0.7), COMMAND - 0.7 * COMMAND * COMMAND * COMMAND)


@pytest.mark.parametrize(
    ("kind", "value"),
    [(ActuatorRateLimit, 4.0), (ActuatorBacklash, 0.4), (ActuatorSaturation, 0.5), (ActuatorDeadband, 0.3)],
)
def test_derivative_in_the_limit_is_the_difference_quotient(kind, value):
    answer = jax.jit(lambda limit: kind("rudder", limit).respond(jnp.asarray(TIMES), NODES))
    slope = jax.jvp(answer, (jnp.asarray(value),), (jnp.asarray(1.0),))[1]
    quotient = (answer(value + 1e-6) - answer(value - 1e-6)) / 2e-6
    assert np.abs(quotient).max() > 0.1
    np.testing.assert_allclose(slope, quotient, atol=1e-6)
