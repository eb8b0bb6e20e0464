"""A body whose attitude is a quaternion: like Euler angles where these hold, and through the vertical."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import stacked
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsub.errors import InputError
from jaxsub.estimate import Problem, gauss_newton
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, integrate, simulate, synthetic
from jaxsub.vehicle import read_vehicle, vehicle_from, vehicle_text
from jaxsub.vehicle.attitude import QUATERNION, quaternion_of
from jaxsub.vehicle.catalogue import bluerov2_heavy

CHANNELS = ("u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "z")
DATA = {
    "schema": 1,
    "name": "acrobat",
    "kind": "submerged-body",
    "body": {
        "mass": 12.0, "weight": 117.0, "buoyancy": 118.0, "inertia": [0.2, 0.3, 0.3],
        "centre_of_buoyancy": [0.0, 0.0, -0.004],
    },
    "model": {"coriolis": "full", "attitude": "quaternion"},
    "coefficients": {
        "X_udot": {"value": -3.0, "fixed": True}, "Z_wdot": {"value": -14.0, "fixed": True},
        "Y_vdot": {"value": -10.0, "fixed": True}, "X_u": -8.0, "Y_v": -12.0, "Z_w": -20.0, "K_p": -0.4, "M_q": -0.6,
        "N_r": -0.6, "B_pitch_loop": 1.0, "B_roll_twist": 1.0, "B_surge_push": 1.0,
    },
    "inputs": {"loop": "m", "twist": "k", "push": "force"},
    "outputs": {**{name: {"sigma": 0.005} for name in CHANNELS}, "x": {"sigma": 0.05}, "y": {"sigma": 0.05}},
}  # fmt: skip
TIMES = 0.05 * np.arange(241)


def body(attitude="quaternion"):
    return vehicle_from({**DATA, "model": {"coriolis": "full", "attitude": attitude}}, "acrobat.toml")


def run(loop, twist=0.0, push=10.0, times=TIMES):
    columns = {"m": np.full(len(times), loop), "k": np.full(len(times), twist), "force": np.full(len(times), push)}
    nothing = dict.fromkeys((*CHANNELS, "x", "y"), np.full(len(times), np.nan))
    return Recording("run", times, columns | nothing, "run")


@pytest.mark.parametrize("whose", ["acrobat", "bluerov2"])
def test_quaternion_moves_as_euler_angles_do_away_from_the_vertical(whose):
    """Claim: all channels of two seconds that roll, pitch and turn differ by less than 1e-9."""
    if whose == "acrobat":
        vehicles, recording = (body("euler"), body()), run(0.1, 0.03, times=TIMES[:41])
    else:
        plain = bluerov2_heavy()
        text = vehicle_text(plain).replace('coriolis = "full"', 'coriolis = "full"\nattitude = "quaternion"')
        columns = {f"t{i + 1}": np.full(41, 0.12 * (-1.0) ** (i // 2)) for i in range(8)}
        nothing = dict.fromkeys(plain.layout.channels, np.full(41, np.nan))
        recording = Recording("run", TIMES[:41], columns | nothing, "run")
        vehicles = (plain, vehicle_from(tomllib.loads(text), "rov.toml"))
    shown = [np.asarray(simulate(v, stacked(v, [recording], substeps=64), at_rest(v, 1))[0]) for v in vehicles]
    assert np.abs(shown[0][:, vehicles[0].layout.channels.index("theta")]).max() > 0.05
    np.testing.assert_allclose(vehicles[0].deviation(*map(jnp.asarray, shown)), 0.0, atol=1e-9)


def test_a_loop_over_the_vertical_is_that_of_scipy_s_rotation():
    """Claim: attitude, velocities and place of a loop with a twist are those of NumPy's equations with a Rotation."""
    vehicle, recording = body(), run(0.9, 0.1)
    states = vehicle.layout.states
    found = np.asarray(
        integrate(vehicle, stacked(vehicle, [recording]), at_rest(vehicle, 1), rtol=1e-11, atol=1e-11)[0]
    )
    M = np.diag([15.0, 22.0, 26.0, 0.2, 0.3, 0.3])
    D = np.diag([8.0, 12.0, 20.0, 0.4, 0.6, 0.6])

    def rates(t, state):
        nu, turn = state[:6], Rotation.from_quat(state[6:10], scalar_first=True)
        low = turn.inv().apply([0.0, 0.0, 1.0])
        excess, arm = 117.0 - 118.0, np.cross([0.0, 0.0, -0.004], -118.0 * low)
        momentum = M @ nu
        gyroscopic = [
            *np.cross(nu[3:], momentum[:3]),
            *(np.cross(nu[3:], momentum[3:]) + np.cross(nu[:3], momentum[:3])),
        ]
        force = np.array([10.0, 0.0, 0.0, 0.1, 0.9, 0.0]) - D @ nu - gyroscopic
        force += np.concatenate([excess * low, arm])
        w, vector = state[6], state[7:10]
        moved = [-0.5 * vector @ nu[3:], *(0.5 * (w * nu[3:] + np.cross(vector, nu[3:])))]
        return np.concatenate([np.linalg.solve(M, force), moved, turn.apply(nu[:3])])

    start = np.concatenate([np.zeros(6), [1.0, 0.0, 0.0, 0.0], np.zeros(3)])
    expected = solve_ivp(rates, (0.0, 12.0), start, "DOP853", TIMES, rtol=1e-12, atol=1e-12).y.T
    quaternions = found[:, [states.index(name) for name in QUATERNION]] + [1.0, 0.0, 0.0, 0.0]
    turns = Rotation.from_quat(quaternions, scalar_first=True)
    upside_down = turns.apply([0.0, 0.0, 1.0])[:, 2] < -0.9
    assert upside_down.any() and not upside_down.all()
    np.testing.assert_allclose(
        turns.as_matrix(), Rotation.from_quat(expected[:, 6:10], scalar_first=True).as_matrix(), atol=1e-7
    )
    np.testing.assert_allclose(found[:, :6], expected[:, :6], atol=1e-7)
    np.testing.assert_allclose(found[:, [states.index(name) for name in "xyz"]], expected[:, 10:], atol=1e-6)
    # and the angles that sensors show are SciPy's of the same rotation
    shown = np.asarray(vehicle.measure(jnp.asarray(TIMES), jnp.asarray(found), jnp.zeros((len(TIMES), 3))))
    angles = shown[:, [vehicle.layout.channels.index(name) for name in ("psi", "theta", "phi")]]
    np.testing.assert_allclose(Rotation.from_euler("ZYX", angles).as_matrix(), turns.as_matrix(), atol=1e-9)


def test_a_body_that_points_straight_up_has_accelerations_and_slopes():
    """Claim: at exactly 90° of pitch all rates and their Jacobian by the state are finite."""
    vehicle = body()
    state = at_rest(vehicle, 1)[0].at[jnp.array([6, 7, 8, 9])].set(quaternion_of([0.0, 0.5 * np.pi, 0.0]))
    state = state.at[:6].set(0.1)
    moved = lambda s: {
        n: r for n, r in vehicle.position_rates(vehicle.motion(s, jnp.zeros(3))).items() if n in vehicle.layout.states
    }
    assert np.isfinite(np.asarray(vehicle.acceleration(state, jnp.zeros(3)))).all()
    slopes = jax.tree.leaves(jax.jacfwd(lambda s: (vehicle.acceleration(s, jnp.zeros(3)), moved(s)))(state))
    assert all(np.isfinite(np.asarray(slope)).all() for slope in slopes)


def test_a_fit_finds_the_coefficients_of_runs_over_the_vertical():
    """Claim: from coefficients 10 % off, a fit of two loops without angles finds them to one per cent."""
    outputs = {name: {"sigma": 0.005} for name in ("u", "w", "q", "z")}
    level = {"dof": ["surge", "heave", "pitch"], "inputs": {"loop": "m", "push": "force"}, "outputs": outputs}
    kept = {name: value for name, value in DATA["coefficients"].items() if "twist" not in name and name[0] in "XZMB"}
    vehicle = vehicle_from({**DATA, **level, "coefficients": kept}, "fit.toml")
    names = ("X_u", "M_q", "B_pitch_loop")
    vehicle = vehicle.holding([row.name for row in vehicle.layout.free if row.name not in names])
    values = vehicle.values()
    runs = stacked(vehicle, synthetic(vehicle, [run(0.9, times=TIMES[:101]), run(-0.8, times=TIMES[:101])], seed=3), 2)
    off = vehicle.with_values({name: 1.1 * values[name] for name in names})
    problem = Problem.of(off, runs, jnp.full(4, 0.005))
    found = problem.split(gauss_newton().run(problem, problem.coordinates()[None]).y[0])[0].values()
    for name in names:
        assert float(found[name]) == pytest.approx(float(values[name]), rel=0.01), name


def test_a_file_with_a_quaternion_reads_back_the_same(tmp_path):
    vehicle = body()
    path = tmp_path / "acrobat.toml"
    path.write_text(vehicle_text(vehicle), encoding="utf-8")
    assert read_vehicle(path).layout.positions == (*QUATERNION, "x", "y", "z")
    assert vehicle_text(read_vehicle(path)) == vehicle_text(vehicle)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"model": {"attitude": "quaternions"}}, "did you mean quaternion"),
        ({"prescribed": {"theta": "pitch"}}, "theta is prescribed"),
        ({"dof": ["surge", "sway", "heave"]}, "none of whose rotations is free"),
    ],
)
def test_attitudes_that_cannot_be_are_refused(change, said):
    with pytest.raises(InputError, match=said):
        vehicle_from(DATA | change, "acrobat.toml")
