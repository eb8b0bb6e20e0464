"""All fits of a diagnosis have wide priors, which the vehicles that it returns do not."""

import dataclasses
import math

import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.discrepancy import settings
from jaxsub.discrepancy.linearise.priors import with_priors_of, with_wide_priors
from jaxsub.effects import CubicStiffness
from jaxsub.estimate import batch, fit, gauss_newton
from jaxsub.simulation import synthetic
from jaxsub.vehicle import vehicle_text

COEFFICIENTS = {
    "D_x": {"value": 0.6, "fixed": True}, "K_x": 3.0, "B_x_drive": {"value": 0.5, "prior_std": 0.1}, "F_x": 0.0,
}  # fmt: skip


def test_only_free_numbers_without_a_prior_get_a_wide_one():
    """Claim: in proportion to their size; none where that is zero. Taken away, the file is the same."""
    vehicle = oscillator(coefficients=COEFFICIENTS)
    wide = with_wide_priors(vehicle)
    found = {row.name: row.prior_std for row in wide.layout.parameters}
    expected = {row.name: row.prior_std for row in vehicle.layout.parameters}
    assert expected.pop("K_x") == math.inf
    assert found.pop("K_x") == 3.0 * settings.PRIOR_WIDTH
    assert found == expected
    effect = CubicStiffness("x", 0.3)
    assert vehicle_text(with_priors_of(vehicle, wide.with_effect(effect))) == vehicle_text(vehicle.with_effect(effect))


@pytest.mark.parametrize(("steps", "near"), [(2, False), (4, True)])
def test_a_search_that_ran_out_of_steps_near_an_optimum_is_at_one(steps, near):
    """Claim: what it lacks is less than a standard error; one that ended early is at none."""
    truth = oscillator()
    inputs = [driven(truth, 0.1 * np.arange(200), 3, amplitude=1.0)]
    runs = batch(truth, synthetic(truth, inputs, seed=4))
    start = truth.with_values({row.name: 1.1 * truth.values()[row.name] for row in truth.layout.free})
    ended = fit(start, runs, method=dataclasses.replace(gauss_newton(1e-300), max_steps=steps))
    assert not ended.converged
    assert ended.at_optimum is near
