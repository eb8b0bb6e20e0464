"""Members of the generated families show the same outputs to rounding, and eq. 6 of the paper is one of them."""

import jax.numpy as jnp
import numpy as np
import pytest
from lateral import diving, lateral
from rigs import driven, oscillator, stacked

from jaxsub.errors import InputError
from jaxsub.information import equivalent_systems
from jaxsub.likelihood import linearise_runs
from jaxsub.simulation import simulate
from jaxsub.simulation.synthesis import at_rest

INERTIA = "Y_vdot Y_pdot Y_rdot K_vdot K_pdot K_rdot N_vdot N_pdot N_rdot"
DAMPING = "Y_v Y_p Y_r K_v K_p K_r N_v N_p N_r"
ATTITUDE = "p r phi psi"
DIVE = "Z_wdot Z_qdot M_wdot M_qdot Z_w Z_q M_w M_q"


@pytest.fixture(scope="module")
def drifting():
    """A body whose sway velocity nothing measures, its inertia and damping free, and its families."""
    vehicle = lateral(ATTITUDE, f"{INERTIA} {DAMPING}")
    return vehicle, equivalent_systems(vehicle)


def whitened(vehicle, start=None):
    """Outputs over sigma along one random recording."""
    layout = vehicle.layout
    runs = stacked(vehicle, [driven(vehicle, 0.25 * np.arange(120), seed=4, amplitude=0.2)])
    origin = at_rest(vehicle, 1) + 0.05 * jnp.arange(1.0, 1.0 + len(layout.equations) + len(layout.positions))
    sigma = np.array([output.sigma for output in layout.outputs])
    return np.asarray(simulate(vehicle, runs, origin if start is None else start(origin))) / sigma


def test_equation_6_of_the_paper_is_a_family(drifting):
    vehicle, families = drifting
    family = next(f for f in families if f.leading == "P[v,p]")
    c = {name: float(value) for name, value in vehicle.values().items()}
    assert family.reinterpreted == ("v",)
    np.testing.assert_allclose(family.tangent.S, np.outer([1, 0, 0, 0, 0], [0, 1, 0, 0, 0]), atol=1e-9)
    np.testing.assert_allclose(family.tangent.T, np.zeros((3, 3)), atol=1e-9)
    # the first paper's eq. 6, and the same for roll and yaw: the fourth column of MP and of AP
    expected = {"Y_pdot": c["Y_vdot"] - c["mass"], "K_pdot": c["K_vdot"], "N_pdot": c["N_vdot"]}
    expected |= {"Y_p": c["Y_v"], "K_p": c["K_v"], "N_p": c["N_v"]}
    assert family.coefficients == pytest.approx(expected, rel=1e-7)
    member = family.member(0.3).vehicle.values()
    for name, change in expected.items():
        assert float(member[name]) == pytest.approx(c[name] + 0.3 * change, rel=1e-9)


def test_members_show_the_same_outputs_and_others_at_that_distance_do_not(drifting):
    vehicle, families = drifting
    truth, original = vehicle.values(), whitened(vehicle)
    rng = np.random.default_rng(3)
    for family in families:
        member = family.member(0.1)
        np.testing.assert_allclose(whitened(member.vehicle, member.start), original, atol=1e-9)
        values = member.vehicle.values()
        # as far from the truth in every coefficient, but some to the other side
        signs = rng.permutation([-1.0] + [1.0] * (len(family.coefficients) - 1))
        flipped = {n: truth[n] + s * (values[n] - truth[n]) for n, s in zip(family.coefficients, signs, strict=True)}
        assert np.abs(whitened(vehicle.with_values(flipped), member.start) - original).max() > 0.01


CASES = {
    "v unmeasured": lateral(ATTITUDE, f"{INERTIA} {DAMPING}"),
    "fins free": diving("w q theta z", f"{DIVE} Z_delta_s M_delta_s"),
}


@pytest.mark.parametrize("vehicle", CASES.values(), ids=CASES)
def test_families_are_as_many_as_the_directions_that_recordings_leave_open(vehicle):
    names = [row.name for row in vehicle.layout.free]
    runs = stacked(vehicle, [driven(vehicle, 0.25 * np.arange(200), seed=s, amplitude=0.2, hold=4) for s in (1, 2)])
    model = linearise_runs(vehicle, runs, at_rest(vehicle, 2) + 0.02)
    sigma = np.array([output.sigma for output in vehicle.layout.outputs])
    weighted = lambda columns: (np.asarray(columns) / sigma[:, None]).reshape(2, -1, columns.shape[-1])
    theta, start = weighted(model.theta), weighted(model.start)
    own = np.concatenate([np.kron(np.eye(2)[run], start[run]) for run in range(2)])
    columns = np.concatenate([theta.reshape(-1, len(names)), own], axis=1)
    unseen = np.all(columns == 0.0, axis=0)
    columns = columns / np.where(unseen, 1.0, np.linalg.norm(columns, axis=0))
    singular = np.linalg.svd(columns, compute_uv=False)
    # an initial state that nothing shows is open as well, but no matter of a coefficient
    open_ = np.sum(singular < 1e-9 * singular[0]) - np.sum(unseen[len(names) :])
    assert len(equivalent_systems(vehicle)) == open_


def test_an_equation_with_a_known_force_cannot_be_multiplied_and_one_without_can():
    free = f"{INERTIA} {DAMPING} Y_delta_r K_delta_er K_delta_el N_delta_r"
    vehicle = lateral(f"v {ATTITUDE}", free)
    heavy = vehicle.with_values({"weight": 1.01 * vehicle.values()["weight"]})
    own = {f"T[{equation},{equation}]" for equation in vehicle.layout.equations}
    leading = lambda vehicle: {family.leading for family in equivalent_systems(vehicle)} & own
    assert leading(vehicle) == {"T[sway,sway]", "T[yaw,yaw]"}
    assert leading(heavy) == {"T[yaw,yaw]"}


def test_shift_of_an_unmeasured_coordinate_drifts_with_the_constant_force():
    rig = oscillator(coefficients={"K_x": 4.0, "F_x": 0.5, "D_x": 0.6}, inputs={}, outputs={"x_rate": {"sigma": 0.02}})
    (family,) = equivalent_systems(rig)
    # K (x₁ + c) = F means K x₁ = F - K c
    assert family.leading == "shift[x]"
    assert family.coefficients == pytest.approx({"F_x": -4.0})
    assert "F_x" in family.sentence()


def test_coefficient_that_no_output_feels_is_a_family_of_its_own():
    rig = oscillator(dof=["a", "b"], coefficients={"K_a": 1.0, "K_b": 2.0}, inputs={}, outputs={"a": {"sigma": 0.1}})
    families = {f.leading: f.coefficients for f in equivalent_systems(rig)}
    assert families == {"K_b": pytest.approx({"K_b": 2.0})}


def test_member_beyond_the_end_of_its_family_is_refused(drifting):
    _, families = drifting
    with pytest.raises(InputError, match="smaller step"):
        next(f for f in families if f.leading == "P[v,v]").member(-1.0)


def test_vehicle_without_free_coefficients_has_no_families():
    assert equivalent_systems(lateral(ATTITUDE, "")) == []
