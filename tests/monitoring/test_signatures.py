"""A change of unit size adds its signature to the whitened innovations, and z² is χ² without one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.monitoring import Signatures, initial_state, model_by_noise, monitor_of, rows_of
from jaxsub.simulation import synthetic


@pytest.fixture(scope="module")
def followed():
    """A monitor of the oscillator, a function from rows to all that it finds in them, and 120 rows."""
    vehicle = oscillator()
    model = model_by_noise(vehicle, 0.1)[0]._replace(longest=25.0)
    monitor = monitor_of(model)
    rows = rows_of(vehicle, synthetic(vehicle, [driven(vehicle, 0.1 * np.arange(120), seed=1)], seed=1))
    begun = monitor.start(initial_state(model, rows[:1]))

    @jax.jit
    def follow(rows):
        def step(state, row):
            after, met, _ = monitor.examined(state, row)
            return after, (met, after.signatures.information, after.score)

        return jax.lax.scan(step, begun, jnp.asarray(rows))[1]

    return monitor, follow, rows


def test_signature_of_a_bias_is_what_the_bias_adds_to_the_innovations(followed):
    """The filter of a linear vehicle is run with and without the bias: finite differences are then exact."""
    monitor, follow, rows = followed
    size = 0.3 * float(monitor.sigma[1])
    moved = rows.copy()
    moved[:, 3] += size
    met, biased = follow(rows)[0], follow(moved)[0]
    added = (np.asarray(biased.white) - np.asarray(met.white)) / 0.3
    signatures, found = Signatures.start(1, 3, 3), []
    for k in range(len(rows)):
        at = jax.tree.map(lambda leaf, k=k: leaf[k], met.at)
        # one window that never begins anew
        signatures, white, _ = Signatures(signatures.D, signatures.age * 0, signatures.information).after(
            at, monitor.sigma
        )
        found.append(white[0, :, 2])
    np.testing.assert_allclose(np.stack(found), added, atol=1e-9)


def test_squares_of_scores_have_mean_one_where_innovations_are_white(followed):
    """χ² of one degree of freedom: 400 series of Gaussian innovations through the shortest windows."""
    _, follow, rows = followed
    met = follow(rows)[0]
    e = np.random.default_rng(3).standard_normal((len(rows), 2, 400))
    signatures, score, means = Signatures.start(2, 3, 3), np.zeros((2, 3, 400)), []
    for k in range(len(rows)):
        at = jax.tree.map(lambda leaf, k=k: leaf[k], met.at)
        signatures, white, fresh = signatures.after(at, jnp.ones(2))
        score = np.where(np.asarray(fresh)[:, None, None], 0.0, score) + np.einsum("mcq,cb->mqb", white, e[k])
        information = np.asarray(signatures.information)[..., None]
        means.append(np.mean(score**2 / np.maximum(information, 1e-300), axis=-1))
    seen = np.asarray(means)[5:]
    assert abs(seen.mean() - 1.0) < 0.05
