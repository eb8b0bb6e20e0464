"""Standard errors of long runs are as large as the residuals make them, white or under a small disturbance."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked

from jaxsub.estimate import SearchEnd, evaluate
from jaxsub.information import coloured_covariance
from jaxsub.results import RESULTS
from jaxsub.simulation import synthetic

DT, SAMPLES = 0.1, 24_000
# with so little damping a force integrates for 100 s into the rate, and for the whole run into the position
COEFFICIENTS = {"D_x": 0.01, "B_x_drive": 2.0}


def ratios(size, time, seed):
    """Corrected standard errors over those of white residuals, and the disturbance found under a Gauss–Markov force."""
    inputs = {"drive": "f", "gust": "g"}
    truth = oscillator(coefficients=COEFFICIENTS | {"B_x_gust": 1.0}, inputs=inputs)
    recording = driven(truth, DT * np.arange(SAMPLES), seed=seed + 1)
    keep, draws = np.exp(-DT / time), np.random.default_rng(seed).standard_normal(SAMPLES)
    force = draws.copy()
    for k in range(1, SAMPLES):
        force[k] = keep * force[k - 1] + np.sqrt(1.0 - keep**2) * draws[k]
    recording = dataclasses.replace(recording, columns=recording.columns | {"g": size * force})
    vehicle = oscillator(coefficients=COEFFICIENTS)
    runs = stacked(vehicle, synthetic(truth, [recording], seed=seed))
    sigma = jnp.asarray([output.sigma for output in vehicle.layout.outputs])
    nothing = jnp.asarray(0.0), jnp.asarray(0), RESULTS.successful
    found = evaluate(SearchEnd(vehicle, runs, jnp.zeros((1, 2)), sigma, *nothing))
    coloured = coloured_covariance(found)
    return np.sqrt(np.diag(coloured.covariance) / np.diag(found.covariance)), coloured.disturbance


@pytest.mark.long
def test_white_residuals_of_a_long_run_leave_standard_errors_as_they_are():
    """Claim: a force that no window of samples can show, but the whole run would, widens no standard error."""
    ratio, _ = ratios(0.0, 1.0, seed=2)
    assert np.all(ratio > 0.95)
    assert np.all(ratio < 1.3)


@pytest.mark.long
def test_small_disturbance_of_a_long_run_is_found():
    """Claim: a force that moves the rate by a tenth of its noise is found, and widens standard errors tenfold."""
    size, time = 1e-4, 3.0
    ratio, found = ratios(size, time, seed=3)
    intensity = float(found.force[0] ** 2 * found.time[0]) / (size**2 * time)
    assert 0.5 < intensity < 2.0
    assert np.all(ratio > 10.0)
