"""The smoother's states and covariances are those of least squares over all samples at once."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.filter import (
    AbstractProcess,
    ConsistentFuzzyNoise,
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    Sample,
    SquareRoot,
    last,
    smooth_block,
)

DENSITY, SIGMA, FIRST = np.array([0.3, 0.1]), 0.5, np.array([2.0, 1.0])


class Mass(AbstractProcess):
    """Position and velocity of a mass on a weak spring; the position is measured."""

    def step(self, x, theta, sample):
        """Along a straight line."""
        return jnp.stack([x[0] + sample.elapsed * x[1], x[1] - 0.2 * sample.elapsed * x[0]])

    def observe(self, x, theta, sample):
        """The position."""
        return x[:1]


def a_run(rng, count=9):
    elapsed = np.concatenate([[0.0], rng.uniform(0.1, 0.9, count - 1)])
    elapsed[4] = 0.0  # two samples of one moment
    mask = (rng.uniform(size=(count, 1)) < 0.7) | (np.arange(count) == 4)[:, None]
    return Sample(jnp.zeros((count, 0)), *map(jnp.asarray, (elapsed, rng.normal(size=(count, 1)), mask)))


def dense(samples, x):
    """States at all samples by least squares: (K, 2) and (K, 2) standard deviations."""
    K = len(samples.elapsed)
    rows, right = [], []

    def add(blocks, value, root):
        row = np.zeros((len(value), 2 * K))
        for at, block in blocks:
            row[:, 2 * at : 2 * at + 2] = block
        rows.append(row / root[:, None])
        right.append(value / root)

    add([(0, np.eye(2))], x, FIRST)
    parts = [np.asarray(part) for part in (samples.elapsed, samples.outputs, samples.mask)]
    for k, (T, z, there) in enumerate(zip(*parts, strict=True)):
        if k:
            F = np.array([[1.0, T], [-0.2 * T, 1.0]])
            add([(k - 1, -F), (k, np.eye(2))], np.zeros(2), np.maximum(DENSITY * np.sqrt(T), 1e-6))
        if there[0]:
            add([(k, np.array([[1.0, 0.0]]))], z, np.array([SIGMA]))
    A, b = np.concatenate(rows), np.concatenate(right)
    Q, R = np.linalg.qr(A)
    back = np.linalg.inv(R)
    return (back @ Q.T @ b).reshape(K, 2), np.linalg.norm(back, axis=1).reshape(K, 2)


def smoothed(filter, samples, x, length):
    """By blocks of `length`, from the last back to the first."""
    state = filter.start(x, jnp.zeros(0), jnp.zeros((0, 0)))
    K = len(samples.elapsed)
    cut = lambda first: jax.tree.map(lambda leaf: leaf[first : first + length], samples)
    states = [state]
    for first in range(0, K, length):
        states.append(jax.lax.scan(lambda s, z: filter.step(s, z), states[-1], cut(first))[0])
    after, found = last(filter, states[-1]), []
    for number, first in reversed(list(enumerate(range(0, K, length)))):
        after, part = smooth_block(filter, states[number], cut(first), after, lambda known, sample: known)
        found.append(part)
    joined = jax.tree.map(lambda *parts: np.concatenate(parts), *found[::-1])
    return joined.x, np.sqrt(np.diagonal(joined.covariance, axis1=1, axis2=2))


@pytest.mark.parametrize("form", [SquareRoot(), Covariance()], ids=["square root", "covariance"])
def test_smoothed_states_are_those_of_least_squares(form):
    """Claim: with gaps and two samples at one moment, states and deviations are a dense solution's."""
    samples, x = a_run(np.random.default_rng(5)), jnp.array([0.4, -0.3])
    noise = ConstantNoise(jnp.diag(jnp.asarray(DENSITY)))
    filter = ExtendedKalmanFilter(Mass(), noise, jnp.array([[SIGMA]]), jnp.diag(jnp.asarray(FIRST)), form)
    expected, std = dense(samples, np.asarray(x))
    found, found_std = smoothed(filter, samples, x, 3)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(found_std, std, rtol=1e-6)


def test_a_rule_that_widens_before_it_corrects_is_smoothed_too():
    """Claim: with the rule that adds noise at a jump, the smoothed deviations are never above the filter's."""
    samples = a_run(np.random.default_rng(6))
    samples = dataclasses.replace(samples, outputs=samples.outputs.at[5:].add(8.0))
    filter = ExtendedKalmanFilter(
        Mass(), ConsistentFuzzyNoise(jnp.asarray(DENSITY)), jnp.array([[SIGMA]]), jnp.diag(jnp.asarray(FIRST))
    )
    start = filter.start(jnp.zeros(2), jnp.zeros(0), jnp.zeros((0, 0)))
    ahead = jax.lax.scan(lambda s, z: filter.step(s, z), start, samples)[1]
    found, std = smoothed(filter, samples, jnp.zeros(2), 9)
    assert (std <= np.asarray(ahead.x_std) * (1.0 + 1e-9)).all()
    np.testing.assert_allclose(found[-1], ahead.x[-1], rtol=1e-12)
