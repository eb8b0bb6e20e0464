"""The gate refuses outliers and few others, what it refuses leaves no trace, and a filter that was wrong can return."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_cases import Linear, sequence
from scipy.stats import norm

from jaxsub.filter import ConstantNoise, Covariance, ExtendedKalmanFilter, InnovationGate, Open, SquareRoot

FORMS = [SquareRoot(), SquareRoot("svd"), Covariance()]
NAMES = ["qr", "svd", "plain"]
F, C = np.array([[1.0, 0.2], [-0.2, 0.9]]), np.eye(2)
Q_ROOT, R_ROOT = np.diag([0.05, 0.05]), np.diag([0.2, 0.3])


def gated(gate, form=SquareRoot()):
    noise = ConstantNoise(jnp.asarray(Q_ROOT))
    return ExtendedKalmanFilter(
        Linear(jnp.asarray(F), jnp.asarray(C)), noise, jnp.asarray(R_ROOT), 0.5 * jnp.eye(2), form, gate
    )


@jax.jit
def follow(filter, samples):
    state = filter.start(jnp.zeros(2), jnp.zeros(0), jnp.zeros((0, 0)))

    def one(state, sample):
        state, estimate = filter.step(state, sample)
        return state, (estimate, state)

    return jax.lax.scan(one, state, samples)[1]


def record(count=100, seed=0, jump=0.0):
    """What the filter is told is true of it, but for a `jump` of the state at sample 30."""
    rng = np.random.default_rng(seed)
    x, inputs, outputs = 0.5 * rng.normal(size=2), rng.normal(size=(count, 2)), []
    for k, u in enumerate(inputs):
        x = F @ x + u + Q_ROOT @ rng.normal(size=2) + jump * (k == 30)
        outputs.append(C @ x + R_ROOT @ rng.normal(size=2))
    return inputs, np.array(outputs)


@pytest.mark.parametrize("form", FORMS, ids=NAMES)
def test_an_outlier_is_refused_and_leaves_no_trace(form):
    """The channel beside it counts, and the filter is that of a record which lacks it."""
    inputs, outputs = record()
    outputs[40, 1] += 10.0
    gate = InnovationGate(jnp.array([6.0, 6.0]), 3)
    seen, states = follow(gated(gate, form), sequence(inputs, outputs))
    lacking = np.ones((100, 2), bool)
    lacking[40, 1] = False
    np.testing.assert_array_equal(seen.used, lacking)
    expected, _ = follow(gated(Open(), form), sequence(inputs, outputs, lacking))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=0, atol=1e-13), seen, expected)
    np.testing.assert_array_equal(states.outside[39:42], [[0, 0], [0, 1], [0, 0]])


def test_refusals_of_what_is_consistent_are_as_many_as_expected():
    """Of 2 x 40 000 measurements, within 4 standard deviations of the binomial of each width."""
    widths = np.array([1.5, 2.5])
    runs = [sequence(*record(1000, seed)) for seed in range(40)]
    # any number may be refused in a row, else the count is another; a third of them in a row never happens here
    filter = gated(InnovationGate(jnp.asarray(widths), 50))
    many = jax.tree.map(lambda *leaves: jnp.stack(leaves), *runs)
    # to refuse consistent measurements makes a filter less consistent: the expected rate is that of one which does not
    seen, _ = jax.vmap(lambda samples: follow(gated(Open()), samples))(many)
    deviations = jnp.sqrt(jnp.einsum("...ij,...ij->...i", seen.factor, seen.factor))
    refused = ~jax.vmap(jax.vmap(filter.gate.inside))(seen.innovation, deviations)
    expected = 2.0 * norm.sf(widths)
    spread = np.sqrt(expected * (1.0 - expected) / 40_000)
    assert (np.abs(refused.mean((0, 1)) - expected) < 4.0 * spread).all()
    shut, _ = jax.vmap(lambda samples: follow(filter, samples))(many)
    assert (np.abs((~shut.used).mean((0, 1)) / expected - 1.0) < 0.25).all()


def test_patience_lets_a_filter_that_was_wrong_return():
    inputs, outputs = record(jump=5.0)
    kept, _ = follow(gated(InnovationGate(jnp.full(2, 5.0), 1000)), sequence(inputs, outputs))
    assert (~kept.used[30:50]).sum() > 20
    seen, states = follow(gated(InnovationGate(jnp.full(2, 5.0), 4)), sequence(inputs, outputs))
    # the other channel turns back inside by itself
    np.testing.assert_array_equal(seen.used[30:35, 0], [False] * 4 + [True])
    np.testing.assert_array_equal(states.outside[30:34, 0], [1, 2, 3, 4])
    # at once, since the state begins anew, and from then on as the filter that believes everything
    free, _ = follow(gated(Open()), sequence(inputs, outputs))
    assert seen.used[34:].all()
    assert np.abs(seen.x[34] - outputs[34])[0] < 1.0
    np.testing.assert_allclose(seen.x[60:], free.x[60:], atol=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_wild_measurements_that_disagree_are_refused_however_many_they_are(seed):
    """Sixty in a row, of all sizes; the filter is that of a record which lacks them."""
    rng = np.random.default_rng(seed)
    inputs, outputs = record()
    outputs[30:90, 1] = rng.choice([-1.0, 1.0], 60) * 10.0 ** rng.uniform(1.5, 12.0, 60)
    lacking = np.ones((100, 2), bool)
    lacking[30:90, 1] = False
    seen, _ = follow(gated(InnovationGate.of(2)), sequence(inputs, outputs))
    expected, _ = follow(gated(InnovationGate.of(2)), sequence(inputs, outputs, lacking))
    np.testing.assert_allclose(seen.x, expected.x, atol=1e-12)


def test_default_width_refuses_one_in_a_million():
    np.testing.assert_allclose(2.0 * norm.sf(InnovationGate.of(3).widths), 1e-6, rtol=1e-6)
    assert np.isinf(InnovationGate.of(1, 0.0).widths).all()


def test_missing_measurements_neither_try_nor_restore_patience():
    inputs, outputs = record()
    outputs[30:] += 5.0
    mask = np.ones((100, 2), bool)
    mask[32:40] = False
    seen, states = follow(gated(InnovationGate(jnp.full(2, 5.0), 4)), sequence(inputs, outputs, mask))
    np.testing.assert_array_equal(states.outside[30:42, 0], [1, *[2] * 9, 3, 4])
    assert not seen.used[30:42].any()
    assert seen.used[42].all()


def test_an_infinite_width_believes_everything():
    inputs, outputs = record()
    outputs[30:, 0] += 50.0
    seen, _ = follow(gated(InnovationGate(jnp.array([jnp.inf, 5.0]), 1000)), sequence(inputs, outputs))
    assert seen.used[:, 0].all()
    everything, _ = follow(gated(InnovationGate(jnp.full(2, jnp.inf), 1000)), sequence(inputs, outputs))
    free, _ = follow(gated(Open()), sequence(inputs, outputs))
    jax.tree.map(np.testing.assert_array_equal, everything, free)
    # the other channel judges by what the first has made of the state
    assert not seen.used[31:34, 1].all()
