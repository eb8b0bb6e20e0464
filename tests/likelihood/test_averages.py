"""Means over groups of samples show what a system's samples show of a force that is linear in time in each group."""

import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from random_systems import random_system

from jaxsub.likelihood import Averages, Disturbance, group_means, propagate

RUNS, SAMPLES, STATES, FORCES, CHANNELS, GROUPS = 2, 11, 3, 2, 2, 3
# samples at which the groups of 10 intervals begin, and the last ends
ENDS = [0, 4, 8, 10]


@pytest.fixture(scope="module")
def system():
    """A random system with samples missing, of one channel a whole group."""
    rng = np.random.default_rng(21)
    measured = rng.random((RUNS, SAMPLES, CHANNELS)) > 0.2
    measured[0, 4:8, 1] = False
    return random_system(rng, measured, STATES, FORCES)


def response(system, start, force):
    """What the channels of a system show from initial states (R, s) under a `force` (R, K, n)."""
    pushed = jnp.concatenate([force[:, :-1], force[:, 1:]], axis=-1)
    states = propagate(system.A, system.G @ pushed[..., None], start[..., None])
    return np.asarray(system.C @ states)[..., 0]


def test_means_are_those_of_the_samples(system):
    """Claim: the coarse system's response is the mean of the fine one's over measured samples, times their root."""
    rng = np.random.default_rng(22)
    at_ends = rng.standard_normal((RUNS, GROUPS + 1, FORCES))
    times = np.pad(np.cumsum(np.asarray(system.intervals), axis=1), [(0, 0), (1, 0)])
    linear = lambda run, force: np.interp(times[run], times[run, ENDS], at_ends[run, :, force])
    force = np.array([[linear(run, force) for force in range(FORCES)] for run in range(RUNS)]).swapaxes(1, 2)
    start = rng.standard_normal((RUNS, STATES))
    shown = response(system, jnp.asarray(start), jnp.asarray(force))
    coarse, means = group_means(system, jnp.asarray(shown[..., None]), GROUPS)
    expected = np.zeros((RUNS, GROUPS + 1, CHANNELS))
    for group, (first, end) in enumerate(itertools.pairwise(ENDS)):
        count = np.asarray(system.measured)[:, first:end].sum(1)
        expected[:, group + 1] = shown[:, first:end].sum(1) / np.sqrt(np.maximum(count, 1))
    begun = jnp.pad(jnp.asarray(start), [(0, 0), (0, CHANNELS)])
    np.testing.assert_allclose(response(coarse, begun, jnp.asarray(at_ends)), expected, atol=1e-12)
    np.testing.assert_allclose(means[..., 0], expected, atol=1e-12)
    assert not coarse.measured[0, 2, 1] and coarse.measured[0, 1].all()
    np.testing.assert_allclose(jnp.sum(coarse.intervals), jnp.sum(system.intervals))


@pytest.mark.parametrize("time", [0.05, 1.0, 50.0])
def test_resampled_force_is_as_intense(system, time):
    """Claim: summed over lags, the force at ends of groups has the covariance of the force at samples."""
    columns = group_means(system, jnp.zeros((RUNS, SAMPLES, CHANNELS, 1)), GROUPS)
    averages = Averages.joined([columns], RUNS * (SAMPLES - 1))
    force = Disturbance(jnp.array([2.0, 0.3]), jnp.full(2, time), jnp.ones(2))
    coarse = averages.resampled(force)
    lags = np.arange(-100_000, 100_001)
    intensity = lambda at, interval: interval * np.sum(np.exp(-np.abs(lags) * interval / time)) * at.force**2
    found = intensity(coarse, float(averages.duration))
    np.testing.assert_allclose(found, intensity(force, float(averages.interval)), rtol=1e-6)
    np.testing.assert_allclose(averages.duration / averages.interval, (SAMPLES - 1) / GROUPS)
