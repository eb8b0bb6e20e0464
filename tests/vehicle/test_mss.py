"""Matrices of the Marine Systems Simulator in, against Fossen's equations of motion written here in NumPy."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from commands import ran
from rigs import stacked
from scipy.integrate import solve_ivp
from scipy.io import savemat

from jaxsub.errors import InputError
from jaxsub.recording import Recording
from jaxsub.simulation import simulate
from jaxsub.vehicle import read_mss, read_vehicle


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


# the BlueROV2 Heavy of von Benzon et al. (2022), with a centre of gravity of its own and coupled added mass
CENTRE = np.array([0.01, -0.005, 0.02])
LEVER = 13.5 * skew(CENTRE)
MRB = np.block([[13.5 * np.eye(3), -LEVER], [LEVER, np.diag([0.26, 0.23, 0.37])]])
MA = np.diag([6.36, 7.12, 18.68, 0.189, 0.135, 0.222])
MA[1, 5] = MA[5, 1] = 0.3
MA[2, 4] = MA[4, 2] = -0.2
D = np.diag([13.7, 2.0, 33.0, 0.5, 0.8, 0.6])
D[1, 5] = 0.7
DN = np.diag([141.0, 217.0, 190.0, 1.19, 0.47, 1.5])
T = np.array([[1.0, 1.0, 0.0], [0.5, -0.5, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.2], [0.3, -0.3, 0.0]])
K = np.array([40.0, 40.0, 25.0])
BUOYANT, WEIGHT, BUOYANCY = np.array([0.0, 0.002, -0.01]), 132.57, 131.588
EVERY = {"MRB": MRB, "MA": MA, "D": D, "Dn": DN, "W": WEIGHT, "B": BUOYANCY, "r_g": CENTRE, "r_b": BUOYANT, "T": T,
         "K": np.diag(K), "rho": 1000.0}  # fmt: skip


def m2c(M, nu):
    """Fossen's (2021) eq. 3.46, the parameterisation that `m2c.m` has."""
    M = 0.5 * (M + M.T)
    one, two = M[:3, :3] @ nu[:3] + M[:3, 3:] @ nu[3:], M[3:, :3] @ nu[:3] + M[3:, 3:] @ nu[3:]
    return np.block([[np.zeros((3, 3)), -skew(one)], [-skew(one), -skew(two)]])


def acceleration(nu, phi, theta, u):
    down = np.array([-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)])
    g = -np.concatenate([(WEIGHT - BUOYANCY) * down, np.cross(CENTRE * WEIGHT - BUOYANT * BUOYANCY, down)])
    forces = T @ (K * u) - (m2c(MRB, nu) + m2c(MA, nu) + D) @ nu - DN @ (np.abs(nu) * nu) - g
    return np.linalg.solve(MRB + MA, forces)


def test_right_hand_side_is_that_of_fossen_s_equations(tmp_path):
    """Claim: accelerations at random states and commands are those of the matrices, as is a second of simulation."""
    savemat(tmp_path / "rov.mat", {"vessel": EVERY | {"L": 0.46}})
    vehicle, lost = read_mss(tmp_path / "rov.mat")
    assert lost == ["L"]
    draws = np.random.default_rng(0)
    for _ in range(5):
        nu, (phi, theta), u = draws.normal(size=6), draws.normal(size=2) * 0.5, draws.normal(size=3)
        state = jnp.array([*nu, phi, theta, 0.3, 2.0])
        np.testing.assert_allclose(vehicle.acceleration(state, jnp.asarray(u)), acceleration(nu, phi, theta, u), 1e-9)
    u = np.array([0.5, 0.4, 0.2])

    def rates(_, x):
        (phi, theta), (p, q, r) = x[6:8], x[3:6]
        turned = q * np.cos(phi) - r * np.sin(phi)
        rolled = p + (q * np.sin(phi) + r * np.cos(phi)) * np.tan(theta)
        return np.concatenate([acceleration(x[:6], phi, theta, u), [rolled, turned]])

    begun = np.array([0.5, 0.1, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1])
    expected = solve_ivp(rates, (0.0, 1.0), begun, "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    columns = dict(zip(vehicle.layout.held, u[:, None] * np.ones(101), strict=True))
    columns |= dict.fromkeys(vehicle.layout.channels, np.full(101, np.nan))
    runs = stacked(vehicle, [Recording("run", 0.01 * np.arange(101), columns, "run")], substeps=4)
    found = simulate(vehicle, runs, jnp.array([[*begun, 0.0, 0.0]]))[0, -1]
    np.testing.assert_allclose(found[:8], expected, rtol=1e-6)


def test_three_equations_are_surge_sway_and_yaw(tmp_path):
    """Claim: horizontal matrices give a vehicle of three degrees of freedom with the same accelerations."""
    rows = np.ix_([0, 1, 5], [0, 1, 5])
    flat = {"MRB": MRB[rows], "MA": MA[rows], "D": D[rows]}
    savemat(tmp_path / "boat.mat", flat)
    vehicle, _ = read_mss(tmp_path / "boat.mat")
    assert vehicle.layout.equations == ("surge", "sway", "yaw")
    nu = np.array([0.8, -0.2, 0.3])
    full = np.insert(nu, 2, np.zeros(3))
    forces = -((m2c(MRB, full) + m2c(MA, full) + D) @ full)[[0, 1, 5]]
    state = jnp.array([*nu, *np.zeros(len(vehicle.layout.positions))])
    expected = np.linalg.solve((MRB + MA)[rows], forces)
    np.testing.assert_allclose(vehicle.acceleration(state, jnp.zeros(0)), expected, rtol=1e-9)


WRONG = {
    "none": ({"M": MRB}, "has no matrix MRB"),
    "shape": ({"MRB": np.eye(4)}, "MRB: is 4 by 4; give a matrix"),
    "other": ({"MRB": MRB, "MA": np.eye(3)}, "MA: is 3 by 3; give 6 by 6"),
    "text": ({"MRB": MRB, "D": "much"}, "D: is no array of numbers"),
    "NaN": ({"MRB": MRB, "D": D * np.nan}, "D: has numbers that are not finite"),
    "centre": ({"MRB": MRB, "r_g": CENTRE + 0.1}, "r_g: is not the centre of gravity of MRB"),
    "gains": ({"MRB": MRB, "T": T, "K": np.ones((3, 3))}, "K: is not diagonal"),
    "inertia": ({"MRB": -MRB}, "mass: is -13.5"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_go_together_is_refused(tmp_path, case):
    variables, said = WRONG[case]
    savemat(tmp_path / "wrong.mat", variables)
    with pytest.raises(InputError, match=said):
        read_mss(tmp_path / "wrong.mat")


def test_command_imports_it(tmp_path, monkeypatch, capsys):
    """Claim: `import` writes a file that reads with the numbers, and a file that is none ends in one line."""
    savemat(tmp_path / "rov.mat", EVERY)
    out = tmp_path / "rov.toml"
    code, said = ran(monkeypatch, capsys, "import", tmp_path / "rov.mat", "--out", out, "--json")
    assert code == 0 and json.loads(said.out)["not_translated"] == []
    assert float(read_vehicle(out).values()["Z_w|w|"]) == -190.0
    for name, content in (("absent.mat", None), ("none.mat", b"nothing")):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        code, said = ran(monkeypatch, capsys, "import", tmp_path / name, "--out", tmp_path / "x.toml")
        assert code == 2 and said.err.count("\n") == 1, said.err
