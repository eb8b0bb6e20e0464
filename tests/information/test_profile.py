"""A profile is the cost of fits with the coefficient held, its interval that of the covariance where that is right."""

import numpy as np
import pytest
from rigs import oscillator, recorded

from jaxsub.errors import InputError
from jaxsub.estimate import fit
from jaxsub.information import profile


@pytest.fixture(scope="module")
def runs():
    """Two recordings of the oscillator."""
    return recorded(oscillator(), 2, 80, 0.1, 1, amplitude=1.0)


@pytest.fixture(scope="module")
def found(runs):
    """The oscillator fitted to them."""
    return fit(oscillator(), runs)


@pytest.fixture(scope="module")
def curves(found):
    """Profiles of all its coefficients."""
    return {curve.name: curve for curve in profile(found, found.names)}


def test_point_of_a_profile_is_a_fit_with_that_coefficient_fixed(found, curves):
    curve = curves["K_x"]
    for index in (0, 9):
        values = found.values | {"K_x": {"value": float(curve.values[index]), "fixed": True}}
        held = fit(oscillator(coefficients=values), found.runs)
        assert 2.0 * float(held.cost - found.cost) == pytest.approx(curve.rise[index], rel=1e-3, abs=1e-3)
    assert curve.rise[6] == pytest.approx(0.0, abs=1e-3)


def test_interval_of_a_nearly_linear_coefficient_is_that_of_its_standard_error(found, curves):
    for curve in (curves["B_x_drive"], curves["D_x"]):
        centre, error = found.values[curve.name], found.standard_errors[curve.name]
        np.testing.assert_allclose(curve.interval, [centre - 1.96 * error, centre + 1.96 * error], atol=0.05 * error)


def test_likelihood_that_does_not_rise_has_no_interval(runs):
    loose = fit(oscillator(coefficients={"I_x": 1.0, "D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}), runs)
    (curve,) = profile(loose, ["D_x"], points=5, width=0.2)
    np.testing.assert_allclose(curve.rise, 0.0, atol=1e-2)
    assert curve.interval == (-np.inf, np.inf)


def test_prior_counts_at_the_value_that_is_held(runs):
    told = fit(oscillator(coefficients={"D_x": 0.6, "K_x": {"value": 4.0, "prior_std": 1e-4}, "B_x_drive": 2.0}), runs)
    (curve,) = profile(told, ["K_x"])
    np.testing.assert_allclose(curve.interval, [told.values["K_x"] + f * 1.96e-4 for f in (-1, 1)], atol=2e-6)


def test_name_that_is_not_free_is_refused(found):
    with pytest.raises(InputError, match="K_x"):
        profile(found, ["K_xx"])
    assert profile(found, []) == []
