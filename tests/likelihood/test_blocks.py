"""Runs taken block by block give what they give at once."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import body, oscillator, recorded

from jaxsub.estimate import fit
from jaxsub.information import coloured_covariance, identifiability
from jaxsub.likelihood import BlockLinearised, blocks, linearise_runs, output_errors
from jaxsub.likelihood.output_error import residual_outputs
from jaxsub.simulation import simulate


@pytest.fixture
def cut(monkeypatch):
    """A function that has runs taken in blocks of so many samples."""

    def cut(samples):
        monkeypatch.setattr(blocks, "_SHORT", 0)
        monkeypatch.setattr(blocks, "_AT_ONCE", samples)

    return cut


def same(one, other, tolerance):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * (1.0 + np.max(np.abs(np.asarray(b)))))


@pytest.mark.parametrize("samples", [74, 160, 298])
def test_linearised_model_does_not_depend_on_the_blocks(cut, samples):
    """Claim: two runs of 151 samples linearised in blocks, joined, equal those linearised whole, to rounding."""
    vehicle = oscillator()
    runs = recorded(vehicle, 2, 151, 0.1, seed=5)
    start, sigma = jnp.zeros((2, 2)), jnp.array([0.01, 0.02])
    whole = linearise_runs(vehicle, runs, start)
    cut(samples)
    shares = []
    found = BlockLinearised.of(vehicle, runs, start, sigma, jnp.ones(2), shares.append)
    assert found.blocks == len(shares) == -(-150 // (samples // 2)) and shares[-1] == 1.0
    same(found.share(0)[1], whole, 1e-12)
    same(found.error, whole.error, 1e-12)
    weight = np.asarray(runs.mask / sigma)[..., None]
    columns = np.concatenate([whole.theta, whole.start, np.asarray(whole.error)[..., None]], axis=-1) * weight
    same(found.products, np.einsum("rkca,rkcb->rab", columns, columns), 1e-11)


def test_window_is_that_part_of_the_whole(cut):
    vehicle = oscillator()
    runs = recorded(vehicle, 3, 101, 0.1, seed=5)
    start = jnp.zeros((3, 2))
    whole = linearise_runs(vehicle, runs, start)
    cut(60)
    found = BlockLinearised.of(vehicle, runs, start, jnp.ones(2), jnp.ones(2))
    window, model = found.window(2, 27, 50)
    np.testing.assert_array_equal(window.times, np.asarray(runs.times)[[2], 27:77])
    same(model.theta, np.asarray(whole.theta)[[2], 27:77], 1e-12)
    same(model.A, np.asarray(whole.A)[[2], 27:76], 1e-12)


def test_turns_of_the_first_sample_hold_in_every_block(cut):
    """Claim: a heading recorded two turns on, first measured late, has the errors of the run taken whole."""
    vehicle = body()
    runs = recorded(vehicle, 1, 81, 0.1, seed=3)
    heading = vehicle.layout.channels.index("psi")
    assert runs.counted[heading]
    mask = np.array(runs.mask)
    mask[0, :30, heading] = False
    outputs = jnp.where(mask, runs.outputs.at[..., heading].add(4.0 * np.pi), 0.0)
    runs = dataclasses.replace(runs, mask=jnp.asarray(mask), outputs=outputs)
    start = jnp.zeros((1, len(vehicle.layout.states))).at[:, 0].set(1.5)
    whole = residual_outputs(vehicle, runs, simulate(vehicle, runs, start))
    assert float(jnp.max(jnp.abs(whole[..., heading]))) < 1.0
    cut(17)
    same(output_errors(vehicle, runs, start), whole, 1e-9)


def test_fit_and_what_follows_do_not_depend_on_the_blocks(cut):
    """Claim: values, covariances and verdicts of a fit in blocks are those of the search that is compiled whole."""
    vehicle = oscillator()
    runs = recorded(vehicle, 2, 151, 0.1, seed=5, amplitude=1.0)

    def answers():
        passes = []
        found = fit(vehicle, runs, passes=lambda done, expected: passes.append((done, expected)))
        coloured, said = coloured_covariance(found), identifiability(found)
        numbers = (found.values, found.covariance, found.cost, coloured.covariance, list(said.uncertainty))
        return found, numbers, [verdict.kind for verdict in said.verdicts], passes

    whole, expected, kinds, _ = answers()
    cut(40)
    found, numbers, others, passes = answers()
    assert found.converged and int(found.steps) == int(whole.steps) and others == kinds
    assert passes[-1] == (float(found.steps) + 1.0,) * 2 and passes == sorted(passes, key=lambda told: told[0])
    same(numbers, expected, 1e-6)
