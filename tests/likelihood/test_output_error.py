"""The likelihood is that of independent Gaussian errors: unmeasured samples and whole turns count for nothing."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven, recorded, stacked
from scipy.optimize import minimize
from scipy.stats import norm

from jaxsub.likelihood import concentrated_sigma, errors, negative_log_likelihood
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, simulate
from jaxsub.vehicle.catalogue import nps_auv_ii

residuals, nll = eqx.filter_jit(errors), eqx.filter_jit(negative_log_likelihood)


@pytest.fixture(scope="module")
def case():
    vehicle = coupled()
    runs = recorded(vehicle, 2, 30, 0.1, seed=1, amplitude=1.0)
    mask = jnp.asarray(np.random.default_rng(1).random(runs.mask.shape) < 0.7)
    runs = dataclasses.replace(runs, mask=mask)
    return vehicle, runs, at_rest(vehicle, 2) + 0.02


def test_likelihood_is_that_of_scipys_normal_distribution(case):
    vehicle, runs, start = case
    sigma = np.array([0.01, 0.03, 0.2])
    density = norm(simulate(vehicle, runs, start), sigma).logpdf(runs.outputs)
    constant = 0.5 * np.log(2.0 * np.pi) * runs.mask.sum()
    found = nll(vehicle, runs, start, jnp.asarray(sigma))
    np.testing.assert_allclose(found, -density[np.asarray(runs.mask)].sum() - constant, rtol=1e-12)


def test_concentrated_likelihood_is_the_minimum_over_sigma(case):
    vehicle, runs, start = case
    error = np.asarray(residuals(vehicle, runs, start))
    count = np.asarray(runs.samples())
    profile = lambda log: 0.5 * np.sum((error / np.exp(log)) ** 2) + count @ log
    best = minimize(profile, np.log([0.1, 0.1, 0.1]), tol=1e-12)
    np.testing.assert_allclose(concentrated_sigma(jnp.asarray(error), runs), np.exp(best.x), rtol=1e-4)
    np.testing.assert_allclose(nll(vehicle, runs, start), best.fun, rtol=1e-9)


def test_unmeasured_samples_carry_no_weight(case):
    vehicle, runs, start = case
    with_outputs = lambda outputs: float(nll(vehicle, dataclasses.replace(runs, outputs=outputs), start))
    same = with_outputs(runs.outputs)
    assert with_outputs(jnp.where(runs.mask, runs.outputs, 1e3)) == same
    assert with_outputs(jnp.where(runs.mask, runs.outputs + 0.1, runs.outputs)) != same


def test_missing_cells_of_a_recording_are_unmeasured(case):
    vehicle, *_ = case
    run = driven(vehicle, 0.1 * np.arange(5), seed=1)
    columns = dict(run.columns) | {name: np.zeros(5) for name in vehicle.layout.channels}
    columns["b"] = np.array([0.0, np.nan, 0.0, np.nan, 0.0])
    runs = stacked(vehicle, [Recording("run", run.times, columns, "run")])
    np.testing.assert_array_equal(runs.samples(), [5, 3, 5])
    assert np.isfinite(nll(vehicle, runs, at_rest(vehicle, 1) + 0.01))


def six_samples(vehicle, counted):
    """A run of a body as it would have been measured without noise, the turns of its angles counted or not."""
    runs = stacked(vehicle, [driven(vehicle, 0.2 * np.arange(6), seed=1)])
    counted = tuple(counted and channel in vehicle.layout.angles for channel in vehicle.layout.channels)
    shown = simulate(vehicle, runs, at_rest(vehicle, 1))
    return dataclasses.replace(runs, mask=jnp.ones_like(runs.mask), outputs=shown, counted=counted)


def test_whole_turns_of_an_angle_are_no_error():
    vehicle = nps_auv_ii()
    runs = six_samples(vehicle, counted=False)
    heading = vehicle.layout.channels.index("psi")
    turned = dataclasses.replace(runs, outputs=runs.outputs.at[0, 2:, heading].add(2.0 * np.pi))
    np.testing.assert_allclose(residuals(vehicle, turned, at_rest(vehicle, 1)), 0.0, atol=1e-12)
    speed = vehicle.layout.channels.index("u")
    faster = dataclasses.replace(runs, outputs=runs.outputs.at[0, 2:, speed].add(2.0 * np.pi))
    np.testing.assert_allclose(residuals(vehicle, faster, at_rest(vehicle, 1))[0, 2:, speed], 2.0 * np.pi)


def test_turns_that_are_counted_are_an_error_but_for_those_of_the_first_sample_measured():
    vehicle = nps_auv_ii()
    runs = six_samples(vehicle, counted=True)
    heading = vehicle.layout.channels.index("psi")
    runs = dataclasses.replace(runs, mask=runs.mask.at[0, 0, heading].set(False))
    turn, start = 2.0 * np.pi, at_rest(vehicle, 1)
    once = dataclasses.replace(runs, outputs=runs.outputs.at[0, :, heading].add(turn))
    np.testing.assert_allclose(residuals(vehicle, once, start), 0.0, atol=1e-12)
    more = dataclasses.replace(runs, outputs=runs.outputs.at[0, 3:, heading].add(turn))
    np.testing.assert_allclose(residuals(vehicle, more, start)[0, :, heading], [0, 0, 0, turn, turn, turn], atol=1e-12)
