"""The catalogue holds the published numbers: coefficients scaled by hand, positive inertia, known stability."""

import numpy as np
import pytest

from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

# worked out by hand from prime values: ½ρL³ = 74438.5, ½ρL²U = 25730.4 (NPS, in fresh water)
SI = {
    "nps": (
        nps_auv_ii,
        {"Y_vdot": -4094.12, "Y_v": -2573.04, "N_r": -11564.3, "K_pdot": -2090.97, "Z_delta_e": -3441.1},
    ),
    "remus": (remus_100, {"Y_vdot": -35.5, "Y_v": -44.044, "N_delta_r": -14.58534, "X_0": 7.683984, "mass": 30.4791}),
    "dsrv": (dsrv, {"mass": 2331.30, "Z_w": -2313.75, "M_q": -14889.4, "M_delta_s": -13848.3, "I_y": 3083.0}),
}


@pytest.mark.parametrize("name", SI)
def test_coefficients_are_the_published_ones_in_si(name):
    make, expected = SI[name]
    values = make().values()
    for coefficient, value in expected.items():
        np.testing.assert_allclose(values[coefficient], value, rtol=2e-5, err_msg=coefficient)


@pytest.mark.parametrize("make", [nps_auv_ii, remus_100])
def test_inertia_is_symmetric_and_positive_definite(make):
    matrix = np.asarray(make().mass_matrix())
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-12)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


def modes(vehicle):
    return np.linalg.eigvals(np.linalg.solve(vehicle.mass_matrix(), vehicle.damping_matrix()))


@pytest.mark.parametrize(("make", "equations"), [(nps_auv_ii, 6), (dsrv, 2)])
def test_velocities_die_out(make, equations):
    found = modes(make())
    assert len(found) == equations
    assert found.real.max() < 0.0


def test_remus_turns_away_from_a_straight_course_as_its_derivatives_have_it():
    v = {name: float(value) for name, value in remus_100().values().items()}
    straight = v["Y_v"] * v["N_r"] - v["N_v"] * (v["Y_r"] - v["mass"] * v["speed"])
    assert straight < 0.0 < modes(remus_100()).real.max()


def test_added_mass_is_fixed_and_the_rest_free():
    free = {row.name for row in nps_auv_ii().layout.free}
    assert {"Y_v", "N_delta_r", "X_0"} <= free
    assert not any(name.endswith("dot") or name in ("mass", "I_x", "weight", "z_B") for name in free)
