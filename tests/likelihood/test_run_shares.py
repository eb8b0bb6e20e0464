"""Runs taken in shares give what they give at once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import oscillator, recorded

from jaxsub.discrepancy.accept.cross_validation import simulated
from jaxsub.discrepancy.linearise.view import guessed
from jaxsub.estimate import estimate_disturbance, fit
from jaxsub.information import coloured_covariance, identifiability
from jaxsub.likelihood import Disturbance, blocks, filter_runs, output_errors, run_shares

SIGMA = jnp.array([0.01, 0.02])


@pytest.fixture(params=["kept", "linearised again"])
def few(monkeypatch, request):
    """A function that has two runs of 101 samples in a share, their linearised model kept or not."""

    def few():
        monkeypatch.setattr(run_shares, "_SAMPLES", 250)
        if request.param != "kept":
            monkeypatch.setattr(blocks, "_SHORT", 400)

    return few


def answers(runs):
    """What is worked out of five runs, by all that passes over them."""
    vehicle = oscillator()
    found = fit(vehicle, runs)
    start, std = jnp.zeros((5, 2)), jnp.array([0.1, 0.1])
    followed = filter_runs(vehicle, runs, SIGMA, Disturbance(np.ones(1), np.ones(1), np.ones(2)), start, std)
    disturbance = estimate_disturbance(followed.system, followed.residual, np.zeros((1, 1)), guessed(found))
    said, errors = identifiability(found), output_errors(vehicle, runs, found.start)
    coloured = coloured_covariance(found, disturbance).covariance
    values = (found.values, found.covariance, found.start, found.model.products, found.model.error, errors)
    return values, followed, disturbance, simulated(found), coloured, list(said.uncertainty)


def test_shares_of_runs_give_what_all_runs_give_at_once(few):
    """Claim: five runs in three shares, the last of which lacks one, give every answer that one share gives."""
    runs = recorded(oscillator(), 5, 101, 0.1, seed=5, amplitude=1.0)
    whole = answers(runs)
    few()
    assert run_shares.shares(5, 101) == [slice(0, 2), slice(2, 4), slice(4, 6)]
    for one, other in zip(*map(jax.tree.leaves, (answers(runs), whole)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6 * (1e-3 + np.max(np.abs(np.asarray(other)))))


def test_progress_of_shares_is_told_in_order_and_ends(few):
    """Claim: shares side by side tell one progress, which does not fall and ends at one."""
    few()
    runs = recorded(oscillator(), 5, 101, 0.1, seed=5)
    told = []
    blocks.summed_products(oscillator(), runs, jnp.zeros((5, 2)), SIGMA, jnp.ones(2), told.append)
    assert len(told) == 3 and told == sorted(told) and told[-1] == pytest.approx(1.0)
