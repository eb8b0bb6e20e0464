"""A followed model is a Kalman filter of state and disturbance, its columns are that filter's derivatives.

The smoothed force is the Gaussian posterior that dense covariances give.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import oscillator, recorded

from jaxsub.effects.hull_damping import QuadraticDamping
from jaxsub.effects.sensor_response import SensorDelay
from jaxsub.likelihood import Columns, Disturbance, filter_runs, smoothed, whitened
from jaxsub.likelihood.readings import readings_of
from jaxsub.parameters import number
from jaxsub.simulation import Sampled

SIGMA = jnp.array([0.01, 0.02])
SPREAD = jnp.array([0.5, 1.0])
DISTURBANCE = Disturbance(jnp.array([0.4]), jnp.array([1.5]), jnp.array([1.1, 0.9]))


@pytest.fixture(scope="module")
def runs():
    runs = recorded(oscillator(), 2, 60, 0.1, seed=3, amplitude=1.0)
    mask = np.random.default_rng(1).random(runs.mask.shape) > 0.2
    return dataclasses.replace(runs, mask=runs.mask & mask, outputs=jnp.where(mask, runs.outputs, 0.0))


def led(vehicle, runs):
    return filter_runs(vehicle, runs, SIGMA, DISTURBANCE, jnp.zeros((2, 2)), SPREAD)


def innovations(vehicle, runs):
    followed = led(vehicle, runs)
    white, factor = whitened(DISTURBANCE, followed.system, followed.residual)
    return np.asarray(jnp.einsum("rkij,rkj->rki", factor, white[..., 0]))


def test_it_is_the_textbook_filter_of_state_and_force(runs):
    vehicle = oscillator()
    sampled = Sampled.of(vehicle, runs)
    nodes = np.asarray(runs.nodes())
    step = jax.jit(lambda x, node, d: sampled.step(x, node, jnp.asarray(0), d))
    by_state = jax.jit(jax.jacfwd(step))
    by_force = jax.jit(jax.jacfwd(step, argnums=2))
    rho = np.exp(-0.1 / 1.5)
    q = 0.4 * np.sqrt(1.0 - rho**2)
    # states are [rate, position] and channels [position, rate]
    C = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    R = np.diag((np.asarray(SIGMA) * [1.1, 0.9]) ** 2)
    m, P, found = np.zeros(3), np.diag([0.25, 1.0, 0.16]), []
    for k in range(60):
        seen = np.asarray(runs.mask)[0, k]
        own, S = C[seen], C[seen] @ P @ C[seen].T + R[np.ix_(seen, seen)]
        error = np.asarray(runs.outputs)[0, k, seen] - own @ m
        expected = np.zeros(2)
        expected[seen] = error
        found.append(expected)
        gain = P @ own.T @ np.linalg.inv(S)
        m, P = m + gain @ error, P - gain @ own @ P
        if k < 59:
            push = np.array([[m[2]], [rho * m[2]]])
            A = np.asarray(by_state(m[:2], nodes[0, k], push))
            begin, end = np.moveaxis(np.asarray(by_force(m[:2], nodes[0, k], push))[..., 0], -1, 0)
            F = np.block([[A, (begin + rho * end)[:, None]], [np.zeros((1, 2)), rho]])
            B = np.concatenate([end, [1.0]])[:, None] * q
            m = np.concatenate([np.asarray(step(m[:2], nodes[0, k], push)), [rho * m[2]]])
            P = F @ P @ F.T + B @ B.T
    np.testing.assert_allclose(innovations(vehicle, runs)[0] * np.asarray(SIGMA), found, atol=1e-9)


def test_columns_of_parameters_are_the_innovations_derivatives(runs):
    vehicle = oscillator()
    followed = led(vehicle, runs)
    white, factor = whitened(DISTURBANCE, followed.system, followed.theta)
    columns = np.asarray(jnp.einsum("rkij,rkjp->rkip", factor, white))
    values = vehicle.values()
    for p, row in enumerate(vehicle.layout.free):
        change = 1e-4 * max(1.0, abs(float(values[row.name])))
        ends = [innovations(vehicle.with_values({row.name: values[row.name] + s * change}), runs) for s in (1.0, -1.0)]
        # a linear model's gains and Jacobians move with its parameters, which columns leave out: near and not equal
        slope = (ends[1] - ends[0]) / (2.0 * change)
        assert np.corrcoef(slope.ravel(), columns[..., p].ravel())[0, 1] > 0.98


def test_a_nonlinear_model_is_followed_where_a_free_run_goes_astray():
    truth = oscillator().with_effect(QuadraticDamping("x", number(-3.0)))
    runs = recorded(truth, 2, 200, 0.1, seed=5, amplitude=3.0)
    free = np.asarray(Sampled.of(oscillator(), runs).states(runs, jnp.zeros((2, 2))))
    wide = dataclasses.replace(DISTURBANCE, force=jnp.array([5.0]))
    followed = filter_runs(oscillator(), runs, SIGMA, wide, jnp.zeros((2, 2)), SPREAD)
    position = np.asarray(runs.outputs)[..., 0]
    away = lambda states: np.sqrt(np.mean((np.asarray(states)[..., 1] - position) ** 2))
    assert away(followed.expected) < 0.1 * away(free)


def test_a_late_sensor_is_a_prompt_one_with_its_readings_moved_back(runs):
    """Claim: the likelihood of a sensor three samples late is that of a prompt one, its readings three samples earlier.

    Under a force that changes as fast as the delay, and with missing readings.
    """
    late = oscillator().with_effect(SensorDelay("x", number(0.3)))
    moved = lambda array: jnp.concatenate([array[:, 3:, :1], jnp.zeros_like(array[:, :3, :1])], axis=1)
    earlier = lambda array: jnp.concatenate([moved(array), array[..., 1:]], axis=2)
    prompt = dataclasses.replace(runs, outputs=earlier(runs.outputs), mask=earlier(runs.mask))
    found, expected = led(late, runs), led(oscillator(), prompt)
    p = len(oscillator().layout.free)
    np.testing.assert_array_equal(found.system.measured, prompt.mask)
    np.testing.assert_allclose(found.expected, expected.expected, atol=1e-12)
    np.testing.assert_allclose(found.residual.shown, expected.residual.shown, atol=1e-9)
    np.testing.assert_allclose(found.products[: 1 + p, : 1 + p], expected.products[: 1 + p, : 1 + p], rtol=1e-9)
    np.testing.assert_allclose(found.log_determinant, expected.log_determinant, rtol=1e-12)


def test_readings_show_the_sample_that_is_their_delay_before():
    """Claim: at uneven times a reading stands at the first sample that is not before what it shows, and at no other."""
    times = np.cumsum(np.random.default_rng(4).uniform(0.05, 0.3, (2, 60)), axis=1)
    runs = dataclasses.replace(recorded(oscillator(), 2, 60, 0.1, seed=3), times=jnp.asarray(times))
    found = readings_of(oscillator().with_effect(SensorDelay("x", number(0.37))), runs)
    np.testing.assert_array_equal(found[..., 1], np.tile(np.arange(60), (2, 1)))
    for own, at in zip(found[..., 0], times, strict=True):
        there = np.flatnonzero(own >= 0)
        shown = at[own[there]] - 0.37
        assert np.all(shown <= at[there] + 1e-6)
        assert np.all(shown[there > 0] > at[there[there > 0] - 1])
        # of a few samples that the same reading would follow the first has it, and the last ones have none
        assert len(set(own[there])) == len(there) > 40 and there[-1] < 59


def test_the_smoothed_force_and_start_are_the_dense_posterior(runs):
    """Claim: mean and variance of the force at every sample, and of a run's initial state, by dense covariances."""
    followed = led(oscillator(), runs)
    system = followed.system
    found = smoothed(DISTURBANCE, system, followed.residual)
    mean, spread = (np.asarray(a)[0, :, 0] for a in (found.force, found.deviation))
    A, G, C = (np.asarray(a)[0] for a in (system.A, system.G, system.C))
    K, mask = 60, np.asarray(system.measured)[0].ravel()
    answer, state, origin = np.zeros((K, 2, K)), np.zeros((2, K)), [np.eye(2)]
    led_away, drift = np.zeros((K, 2)), np.zeros(2)
    for k in range(K):
        answer[k] = C[k] @ state
        led_away[k] = C[k] @ drift
        if k < K - 1:
            state, drift = A[k] @ state, A[k] @ drift + np.asarray(followed.residual.forcing)[0, k, :, 0]
            state[:, k] += G[k][:, 0]
            state[:, k + 1] += G[k][:, 1]
            origin.append(A[k] @ origin[-1])
    prior = 0.16 * np.exp(-0.1 * np.abs(np.subtract.outer(np.arange(K), np.arange(K))) / 1.5)
    begun = np.stack([C[k] @ origin[k] for k in range(K)]).reshape(2 * K, 2) * np.asarray(SPREAD)
    H = answer.reshape(2 * K, K)[mask]
    noise = np.diag(np.tile([1.1**2, 0.9**2], K)[mask]) + (begun @ begun.T)[np.ix_(mask, mask)]
    data = (np.asarray(followed.residual.shown)[0, ..., 0] + led_away).ravel()[mask]
    gain = prior @ H.T @ np.linalg.inv(H @ prior @ H.T + noise)
    np.testing.assert_allclose(mean, gain @ data, atol=1e-8)
    np.testing.assert_allclose(spread**2, np.diag(prior - gain @ H @ prior), atol=1e-8)
    begun = begun[mask] * np.asarray(SPREAD)
    gain = begun.T @ np.linalg.inv(H @ prior @ H.T + noise)
    np.testing.assert_allclose(np.asarray(found.start)[0], gain @ data, atol=1e-8)
    covariance = np.diag(np.asarray(SPREAD) ** 2) - gain @ begun
    np.testing.assert_allclose(np.asarray(found.covariance)[0], covariance, atol=1e-8)


def test_path_begins_as_sure_of_an_unmeasured_velocity_as_is_said():
    """Claim: of a rate that nothing measures, the first filtered samples are five times nearer the truth with `begin`.

    The linear model along the path keeps the wide prior.
    """
    runs = recorded(oscillator(), 2, 60, 0.1, seed=3, amplitude=1.0)
    unseen = dataclasses.replace(runs, mask=runs.mask & jnp.array([True, False]))
    true = Sampled.of(oscillator(), runs).states(runs, jnp.zeros((2, 2)))
    quiet = dataclasses.replace(DISTURBANCE, force=jnp.array([1e-3]))
    sure = np.broadcast_to(np.diag([1e-6, 1e-6]), (2, 2, 2))
    wide, near = (
        filter_runs(oscillator(), unseen, SIGMA, quiet, jnp.zeros((2, 2)), SPREAD, begin) for begin in (None, sure)
    )
    off = lambda one: float(jnp.abs(one.filtered - true)[:, :5, 0].max())
    assert off(near) < 0.2 * off(wide)
    np.testing.assert_array_equal(near.system.start_std, SPREAD)


def test_columns_side_by_side_are_whitened_each_as_alone(runs):
    followed = led(oscillator(), runs)
    both = followed.residual + followed.theta
    assert isinstance(both, Columns)
    together = whitened(DISTURBANCE, followed.system, both)[0]
    alone = whitened(DISTURBANCE, followed.system, followed.theta)[0]
    np.testing.assert_allclose(together[..., 1:], alone, atol=1e-10)
    assert eqx.tree_equal(jnp.isfinite(together).all(), jnp.asarray(True))
