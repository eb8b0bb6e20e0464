"""The consistent fuzzy rule finds how large the noise is, answers a jump at once, and leaves the rest alone."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float
from scipy.stats import chi2

from jaxsub.filter import (
    AbstractProcess,
    ConsistentFuzzyNoise,
    ConstantNoise,
    ExtendedKalmanFilter,
    Innovation,
    ModifiedKalmanFilter,
    Residuals,
    Sample,
)

INTERVAL, SAMPLES, SEEDS = 0.5, 600, 60
ANGLE, BIAS, SENSOR = 0.05, 0.002, 0.5
NOTHING = Residuals.none(jnp.eye(4), jnp.eye(2))


class Turntable(AbstractProcess):
    """An angle that a biased rate gyro follows: x = [angle, bias], one channel."""

    def step(self, x: Float[Array, "2"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "2"]:
        return jnp.stack([x[0] + sample.elapsed * (sample.inputs[0] - x[1]), x[1]])

    def observe(self, x: Float[Array, "2"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "1"]:
        return x[:1]


def runs(jump: float = 0.0) -> tuple[Sample, np.ndarray]:
    """Samples of a table at rest whose angle jumps unseen at half time, (seeds, K), and the true states."""
    rng = np.random.default_rng(11)
    shape = (SEEDS, SAMPLES)
    bias = np.cumsum(BIAS * np.sqrt(INTERVAL) * rng.standard_normal(shape), axis=1)
    walk = np.cumsum(ANGLE * np.sqrt(INTERVAL) * rng.standard_normal(shape), axis=1)
    angle = walk + jump * (np.arange(SAMPLES) >= SAMPLES // 2)
    measured = angle + SENSOR * rng.standard_normal(shape)
    elapsed = np.full(shape, INTERVAL)
    # the gyro does not see the walk: it is the process's noise
    samples = Sample(*map(jnp.asarray, (bias[..., None], elapsed, measured[..., None], np.ones((*shape, 1), bool))))
    return samples, np.stack([angle, bias], axis=-1)


def followed(rule, samples: Sample, kind=ExtendedKalmanFilter):
    """What a filter with `rule` makes of all runs."""
    filter = kind(Turntable(), rule, jnp.array([[SENSOR]]), jnp.diag(jnp.array([0.5, 0.05])))

    def one(samples: Sample):
        start = filter.start(jnp.zeros(2), jnp.zeros(0), jnp.zeros((0, 0)))
        return jax.lax.scan(lambda state, sample: filter.step(state, sample), start, samples)[1]

    return jax.jit(jax.vmap(one))(samples)


def steady_nis(found) -> float:
    """Mean over runs and the last third."""
    nis = (found.innovation[..., 0] / found.factor[..., 0, 0]) ** 2
    return float(jnp.mean(nis[:, -SAMPLES // 3 :]))


@pytest.mark.parametrize("wrong", [0.2, pytest.param(1.0, marks=pytest.mark.long), 5.0])
def test_a_density_that_is_wrong_fivefold_either_way_ends_consistent(wrong):
    samples, _ = runs()
    density = wrong * jnp.array([ANGLE, BIAS])
    # neighbours share the state's error and λ's: a fifth of the samples counts as independent
    count = SEEDS * SAMPLES // 15
    low, high = (float(chi2.ppf(p, count)) / count for p in (0.025, 0.975))
    assert low < steady_nis(followed(ConsistentFuzzyNoise(density, speed=0.1), samples)) < high
    constant = steady_nis(followed(ConstantNoise(jnp.diag(density)), samples))
    assert (low < constant < high) == (wrong == 1.0)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, ModifiedKalmanFilter])
def test_an_unseen_jump_is_followed_at_once_and_not_put_down_to_the_bias(kind):
    jump = 15.0
    samples, truth = runs(jump)
    rule = ConsistentFuzzyNoise(jnp.array([ANGLE, BIAS]))
    ours = followed(rule, samples, kind)
    constant = followed(ConstantNoise(jnp.diag(rule.density)), samples, kind)
    after = slice(SAMPLES // 2 + 2, SAMPLES // 2 + 10)
    error = lambda found, of: np.abs(np.asarray(found.x[..., of]) - truth[..., of])[:, after]
    assert np.median(error(ours, 0)) < 0.1 * jump
    assert np.median(error(constant, 0)) > 0.3 * jump
    assert np.median(error(ours, 1)) < 0.5 * np.median(error(constant, 1))
    assert np.all(np.isfinite(ours.x_std)) and np.all(np.asarray(ours.x_std) > 0.0)


def test_innovations_that_the_filter_expects_widen_nothing():
    samples, _ = runs()
    rule = ConsistentFuzzyNoise(jnp.array([ANGLE, BIAS]), speed=0.0)
    found = followed(rule, samples)
    beyond = np.asarray(found.noise_std[..., 0] > 1.0001 * ANGLE * np.sqrt(INTERVAL))
    # three standard deviations: 0.27 % of them; the state's noise then comes back in a few more
    assert np.mean(beyond) < 0.006


def test_the_least_disturbance_explains_the_innovation_and_favours_what_varies_most():
    rng = np.random.default_rng(3)
    density = jnp.array([1.0, 0.1, 2.0, 0.5])
    C, value = jnp.asarray(rng.normal(size=(2, 4))), jnp.array([30.0, -40.0])
    seen = Innovation(value, jnp.ones(2, bool), C, jnp.eye(2), 1e-6 * jnp.eye(2))
    rule = ConsistentFuzzyNoise(density, widths=0.0)
    W = np.diag(np.asarray(density) ** 2)
    expected = W @ C.T @ np.linalg.solve(C @ W @ C.T, value)
    memory = rule.start()
    memory, _ = rule(memory, NOTHING, jnp.asarray(2.0))
    memory, root = rule.surprise(memory, seen)
    np.testing.assert_allclose(memory.window.values[-1], expected, rtol=1e-4)
    # one residual alone has no slope: the first jump of all is left to the gain
    np.testing.assert_array_equal(root, 0.0)


def test_missing_measurements_change_nothing():
    rule = ConsistentFuzzyNoise(jnp.array([1.0, 2.0]))
    memory, _ = rule(rule.start(), NOTHING, jnp.asarray(1.0))
    seen = Innovation(9.0 * jnp.ones(1), jnp.ones(1, bool), jnp.ones((1, 2)), jnp.eye(1), jnp.eye(1))
    memory, _ = rule(rule.surprise(memory, seen)[0], NOTHING, jnp.asarray(1.0))
    seen = Innovation(jnp.zeros(1), jnp.zeros(1, bool), jnp.ones((1, 2)), jnp.eye(1), jnp.eye(1))
    after, root = rule.surprise(memory, seen)
    np.testing.assert_array_equal(root, 0.0)
    assert jax.tree.all(jax.tree.map(lambda a, b: bool(jnp.all(a == b)), memory, after))
