"""A search goes on from where another one ended."""

import jax.numpy as jnp
import numpy as np
from rigs import oscillator, recorded

from jaxsub.estimate import continued, search


def test_a_search_that_goes_on_from_an_optimum_stays_there():
    """Claim: numbers and initial states are those where the first ended, which took several times as many steps."""
    vehicle = oscillator()
    runs = recorded(vehicle, 2, 80, 0.1, seed=3, amplitude=1.0)
    far = vehicle.with_values({row.name: 1.3 * vehicle.values()[row.name] for row in vehicle.layout.free})
    ended = search(far, runs, sigma=jnp.array([0.01, 0.02]))
    again = continued(ended)
    assert int(again.steps) <= 2 < int(ended.steps) / 2
    np.testing.assert_allclose(float(again.cost), float(ended.cost), rtol=1e-6)
    np.testing.assert_allclose(again.start, ended.start, atol=1e-4)
