"""Coefficients estimated from dimensions, against published tables, closed forms and quadrature."""

import numpy as np
import pytest
from scipy.integrate import quad

from jaxsub.vehicle.geometry import (
    added_inertia_factors,
    added_mass_factors,
    crossflow_drag,
    form_factor,
    friction_drag,
    lamb_factors,
    lift_slope,
    skin_friction,
)

# Lamb (1932), §§114 and 115: length by breadth of a prolate spheroid, k along, across and in turning
LAMB = [
    (1.0, 0.5, 0.5, 0.0),
    (1.5, 0.305, 0.621, 0.094),
    (2.0, 0.209, 0.702, 0.240),
    (2.99, 0.122, 0.803, 0.465),
    (3.99, 0.082, 0.860, 0.608),
    (4.99, 0.059, 0.895, 0.701),
    (6.01, 0.045, 0.918, 0.764),
    (6.97, 0.036, 0.933, 0.805),
    (8.01, 0.029, 0.945, 0.840),
    (9.02, 0.024, 0.954, 0.865),
    (9.97, 0.021, 0.960, 0.883),
]


@pytest.mark.parametrize(("ratio", "along", "across", "turning"), LAMB)
def test_factors_of_a_spheroid_are_lambs_table(ratio, along, across, turning):
    """Claim: k1, k2 and k' are those that Lamb printed to three digits, whichever axis is the long one."""
    for axis in range(3):
        axes = np.roll([ratio, 1.0, 1.0], axis)
        assert np.roll(added_mass_factors(*axes), -axis) == pytest.approx([along, across, across], abs=2.5e-3)
        assert np.roll(added_inertia_factors(*axes), -axis) == pytest.approx([0.0, turning, turning], abs=2.5e-3)


@pytest.mark.parametrize("ratio", [1.1, 3.0, 12.0])
def test_factors_of_a_spheroid_are_the_closed_form(ratio):
    """Claim: elliptic integrals give the logarithms of a spheroid to rounding; Fossen (2021), §6.3 has them."""
    e = np.sqrt(1.0 - 1.0 / ratio**2)
    log = np.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e**2) / e**3 * (0.5 * log - e)
    beta = 1.0 / e**2 - (1.0 - e**2) / (2.0 * e**3) * log
    assert lamb_factors(ratio, 1.0, 1.0) == pytest.approx((alpha, beta, beta), rel=1e-9)
    turning = e**4 * (beta - alpha) / ((2.0 - e**2) * (2.0 * e**2 - (2.0 - e**2) * (beta - alpha)))
    assert added_inertia_factors(ratio, 1.0, 1.0)[2] == pytest.approx(turning, rel=1e-7)


def test_factors_of_three_axes_are_the_integrals():
    """Claim: of a hull with three axes they are Lamb's integrals, taken here by quadrature."""
    axes = np.array([2.0, 0.7, 0.4])

    def integral(i):
        slope = lambda s: 1.0 / ((axes[i] ** 2 + s) * np.sqrt(np.prod(axes**2 + s)))
        return np.prod(axes) * quad(slope, 0.0, np.inf, epsabs=0.0, epsrel=1e-10)[0]

    alpha, beta, gamma = (integral(i) for i in range(3))
    assert lamb_factors(*axes) == pytest.approx((alpha, beta, gamma), rel=1e-8)
    assert sum(lamb_factors(*axes)) == pytest.approx(2.0, rel=1e-12)
    b, c = axes[1:] ** 2
    rolling = (b - c) ** 2 * (gamma - beta) / ((b + c) * (2.0 * (b - c) + (b + c) * (beta - gamma)))
    assert added_inertia_factors(*axes)[0] == pytest.approx(rolling, rel=1e-8)


def test_a_long_cylinder_moves_its_own_water():
    """Claim: across a long round hull k is 1, across an elliptic one it is the ratio of its axes."""
    assert added_mass_factors(1e4, 1.0, 1.0)[1] == pytest.approx(1.0, rel=1e-4)
    assert added_mass_factors(1e4, 1.0, 3.0)[1] == pytest.approx(3.0, rel=1e-3)


def test_friction_is_the_ittc_line():
    """Claim: C_F is 0.003 at a Reynolds number of 1e7 and 0.001875 less than twice itself at 1e6; drag follows it."""
    of = lambda reynolds: skin_friction(1.19e-6 * reynolds, 1.0)
    assert (of(1e7), of(1e6), of(1e9)) == pytest.approx((0.003, 0.0046875, 0.075 / 49.0), rel=1e-12)
    assert friction_drag(1000.0, 2.0, 1.19e-6 * 1e7, 1.0, form=1.2) == pytest.approx(3.6)
    assert np.isfinite(skin_friction(0.0, 1.0))
    assert form_factor(10.0, 1.0) == pytest.approx(1.0 + 1.5 / 10**1.5 + 0.007)


def test_strips_add_up_to_the_integral():
    """Claim: drag and its moment in turning are the sums over thin strips."""
    x = (np.arange(20000) + 0.5) / 20000 * 3.0 - 1.5
    half = 0.5 * 1025.0 * 1.1 * 0.2 * 3.0 / len(x)
    force, moment = crossflow_drag(1025.0, 3.0, 0.2, 1.1)
    assert force == pytest.approx(half * len(x))
    assert moment == pytest.approx(np.sum(half * abs(x) ** 3), rel=1e-6)


def test_lift_slope_has_the_limits_of_wing_theory():
    """Claim: 2π of an endless wing, half π times the aspect ratio of a short one (Jones 1946)."""
    assert lift_slope(1e6) == pytest.approx(2.0 * np.pi, rel=1e-5)
    assert lift_slope(1e-3) == pytest.approx(0.5e-3 * np.pi, rel=1e-3)
