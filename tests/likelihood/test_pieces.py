"""Jacobians of long runs, taken piece by piece, are those taken at once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.likelihood import sensitivity
from jaxsub.likelihood.sensitivity import linearise
from tests.rigs import coupled, recorded


@pytest.mark.parametrize("at_once", [37, 100, 301])
def test_linearised_model_does_not_depend_on_the_pieces(monkeypatch, at_once):
    """Claim: two runs of 151 samples linearised in pieces equal those linearised whole, to rounding."""
    vehicle = coupled()
    runs = recorded(vehicle, 2, 151, 0.1, seed=5)
    start = jnp.zeros((2, 4))
    whole = linearise(vehicle, runs, start)
    monkeypatch.setattr(sensitivity, "_AT_ONCE", at_once)
    pieces = sensitivity.linearise.__wrapped__(vehicle, runs, start)
    for one, other in zip(jax.tree.leaves(whole), jax.tree.leaves(pieces), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-12, atol=1e-14)
