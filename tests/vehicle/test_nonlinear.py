"""`[model] coriolis`: accelerations of a body against Fossen's equations, written here by hand in NumPy."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked

from jaxsub.effects import EQUATIONS, Current, QuadraticDamping
from jaxsub.errors import InputError
from jaxsub.simulation import at_rest, simulate
from jaxsub.vehicle import vehicle_from, vehicle_text

MASS, INERTIA, CG, CB = 60.0, (1.1, 12.0, 13.0), (0.02, -0.01, 0.03), (-0.015, 0.005, -0.02)
WEIGHT, BUOYANCY = 60.0 * 9.80665, 600.0
ADDED = {"X_udot": -5.0, "Y_vdot": -60.0, "Z_wdot": -55.0, "K_pdot": -0.4, "M_qdot": -20.0, "N_rdot": -22.0,
         "Y_rdot": 3.0, "N_vdot": 3.0, "Z_qdot": -2.0, "M_wdot": -2.0}  # fmt: skip
LINEAR = {"X_u": -3.0, "Y_v": -20.0, "Y_r": 4.0, "Z_w": -25.0, "K_p": -1.5, "M_q": -9.0, "N_r": -11.0, "N_v": 2.0}
SQUARES = {"X_u|u|": -4.0, "Y_v|v|": -70.0, "Z_w|w|": -90.0, "K_p|p|": -0.8, "M_q|q|": -15.0, "N_r|r|": -18.0}
ORDER = "uvwpqr"


def tree(coriolis, **changes):
    return {
        "schema": 1, "name": "hull", "kind": "submerged-body",
        "body": {"mass": MASS, "inertia": list(INERTIA), "weight": WEIGHT, "buoyancy": BUOYANCY, "speed": 1.4,
                 "centre_of_gravity": list(CG), "centre_of_buoyancy": list(CB)},
        "model": {"coriolis": coriolis}, "coefficients": ADDED | LINEAR | SQUARES,
        "outputs": {name: {"sigma": 0.01} for name in (*ORDER, "phi", "theta", "psi", "x", "y", "z")},
    } | changes  # fmt: skip


def skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rigid():
    """Fossen (2021), eq. 3.49."""
    matrix = np.diag([MASS] * 3 + list(INERTIA))
    matrix[:3, 3:], matrix[3:, :3] = -MASS * skew(CG), MASS * skew(CG)
    return matrix


def added():
    matrix = np.zeros((6, 6))
    for name, value in ADDED.items():
        matrix["XYZKMN".index(name[0]), ORDER.index(name[2])] = -value
    return matrix


def coriolis(matrix, nu):
    """Fossen (2021), theorem 3.2: the matrix C(ν) of a 6 × 6 inertia matrix."""
    a = matrix[:3, :3] @ nu[:3] + matrix[:3, 3:] @ nu[3:]
    b = matrix[3:, :3] @ nu[:3] + matrix[3:, 3:] @ nu[3:]
    C = np.zeros((6, 6))
    C[:3, 3:] = C[3:, :3] = -skew(a)
    C[3:, 3:] = -skew(b)
    return C


def rotation(phi, theta, psi):
    """From body axes to north, east, down (Fossen 2021, eq. 2.31)."""
    cx, sx, cy, sy, cz, sz = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta), np.cos(psi), np.sin(psi)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    return np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ about_y @ about_x


def restoring(attitude):
    """g(η) of Fossen (2021), eq. 4.6, by forces and arms in place of the components."""
    down = rotation(*attitude).T @ np.array([0.0, 0.0, 1.0])
    moment = np.cross(CG, WEIGHT * down) - np.cross(CB, BUOYANCY * down)
    return -np.concatenate([(WEIGHT - BUOYANCY) * down, moment])


def damping(nu):
    force = np.zeros(6)
    for name, value in LINEAR.items():
        force["XYZKMN".index(name[0])] += value * nu[ORDER.index(name[2])]
    for name, value in SQUARES.items():
        i = ORDER.index(name[2])
        force["XYZKMN".index(name[0])] += value * abs(nu[i]) * nu[i]
    return force


def fossen(nu, attitude, stream=(0.0, 0.0, 0.0), with_added=True):
    """Accelerations over ground (Fossen 2021, eqs. 6.114 and 10.134): M ν̇_r + C(ν_r)ν_r + D(ν_r)ν_r + g(η) = 0."""
    current = rotation(*attitude).T @ np.array(stream)
    relative = nu - np.concatenate([current, np.zeros(3)])
    M = rigid() + added()
    turning = coriolis(rigid(), nu) @ nu + (coriolis(added(), relative) @ relative if with_added else 0.0)
    current_rate = np.concatenate([-skew(nu[3:]) @ current, np.zeros(3)])
    # M_RB ν̇ + C_RB(ν)ν of the body over ground, M_A ν̇_r + C_A(ν_r)ν_r of the water's share
    force = damping(relative) - restoring(attitude) - turning + added() @ current_rate
    return np.linalg.solve(M, force)


def states(vehicle, count=6, seed=0):
    draws = np.random.default_rng(seed)
    names = vehicle.layout.states
    table = draws.normal(size=(count, len(names))) * 0.7
    return table, table[:, :6], table[:, [names.index(a) for a in ("phi", "theta", "psi")]]


@pytest.mark.parametrize("choice", ["full", "rigid-body"])
def test_accelerations_are_those_of_fossens_equations(choice):
    """Claim: rigid body about any origin, added mass, linear and square damping, weight and buoyancy, to 1e-10."""
    vehicle = vehicle_from(tree(choice), "hull.toml")
    table, nu, attitude = states(vehicle)
    found = vehicle.acceleration(jnp.asarray(table), jnp.zeros((len(table), 0)))
    expected = [fossen(a, b, with_added=choice == "full") for a, b in zip(nu, attitude, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


def test_accelerations_in_a_current_are_those_of_fossens_equations():
    """Claim: with a recorded current the rigid body turns over ground and the water's share through the water."""
    columns = {"current_north": "V_N", "current_east": "V_E"}
    vehicle = vehicle_from(tree("full", environment=columns), "hull.toml")
    table, nu, attitude = states(vehicle, seed=1)
    streams = np.random.default_rng(2).normal(size=(len(table), 2))
    found = vehicle.acceleration(jnp.asarray(table), jnp.asarray(streams))
    expected = [fossen(a, b, (*c, 0.0)) for a, b, c in zip(nu, attitude, streams, strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("choice", ["linear", "full"])
def test_a_current_of_an_effect_is_one_of_a_recording(choice):
    """Claim: accelerations are those with constant columns, and with both those with their sum; effects follow too."""
    columns = {"current_north": "V_N", "current_east": "V_E"}
    drag = QuadraticDamping("sway", jnp.asarray(-60.0))
    recorded = vehicle_from(tree(choice, environment=columns), "hull.toml").with_effect(drag)
    still = vehicle_from(tree(choice), "hull.toml").with_effect(drag)
    table = jnp.asarray(states(still, seed=3)[0])
    streams = lambda north, east: jnp.broadcast_to(jnp.array([north, east]), (len(table), 2))
    current = lambda north, east: Current(EQUATIONS, jnp.asarray(north), jnp.asarray(east))
    expected = recorded.acceleration(table, streams(0.4, -0.3))
    alone = still.with_effect(current(0.4, -0.3)).acceleration(table, jnp.zeros((len(table), 0)))
    both = recorded.with_effect(current(0.3, 0.1)).acceleration(table, streams(0.1, -0.4))
    assert np.max(abs(expected - recorded.acceleration(table, streams(0.0, 0.0)))) > 0.01
    np.testing.assert_allclose(alone, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(both, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("choice", ["linear", "full"])
def test_a_body_in_a_current_drifts_with_the_water_and_else_moves_as_without_it(choice):
    """Claim: seen from the water a run in a steady current is the run in water at rest, whatever the model."""
    north, east = 0.4, -0.3
    still = vehicle_from(tree(choice), "hull.toml")
    vehicle = vehicle_from(tree(choice, environment={"current_north": "V_N", "current_east": "V_E"}), "hull.toml")
    times = 0.05 * np.arange(60)
    run = driven(vehicle, times, seed=1)
    run = type(run)(run.name, times, run.columns | {"V_N": np.full(60, north), "V_E": np.full(60, east)}, run.source)
    runs, calm = stacked(vehicle, [run], substeps=4), stacked(still, [run], substeps=4)
    start = at_rest(still, 1).at[0, :6].set(jnp.array([1.2, 0.1, -0.1, 0.2, 0.1, -0.2]))
    moving = start.at[0, :3].add(jnp.asarray(rotation(0.0, 0.0, 0.0).T @ np.array([north, east, 0.0])))
    one, two = np.asarray(simulate(vehicle, runs, moving))[0], np.asarray(simulate(still, calm, start))[0]
    shown = list(vehicle.layout.channels)
    carried = {"x": north * times, "y": east * times}
    for name in ("p", "q", "r", "phi", "theta", "psi", "x", "y", "z"):
        expected = two[:, shown.index(name)] + carried.get(name, 0.0)
        np.testing.assert_allclose(one[:, shown.index(name)], expected, atol=1e-5, err_msg=name)


def test_linear_is_the_linearisation_of_the_rigid_body_about_the_operating_speed():
    """Claim: slopes of both models at U_c ahead agree, the centre of gravity away from the origin included."""
    linear, nonlinear = (vehicle_from(tree(choice), "hull.toml") for choice in ("linear", "rigid-body"))
    state = jnp.zeros(12).at[0].set(1.4)
    slopes = [jax.jacfwd(lambda s, v=v: v.acceleration(s, jnp.zeros(0)))(state) for v in (linear, nonlinear)]
    np.testing.assert_allclose(*slopes, atol=1e-10)
    vehicle = vehicle_from(tree("full"), "hull.toml")
    assert np.abs(jax.jacfwd(lambda s: vehicle.acceleration(s, jnp.zeros(0)))(state) - slopes[0]).max() > 0.1


def test_model_is_written_and_a_word_that_is_none_is_refused():
    for choice in ("linear", "rigid-body", "full"):
        vehicle = vehicle_from(tree(choice), "hull.toml")
        again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
        assert again.coriolis == choice
        assert vehicle_text(again) == vehicle_text(vehicle)
    for model, said in (({"coriolis": "ful"}, "did you mean full"), ({"coriolsi": "full"}, "did you mean coriolis")):
        with pytest.raises(InputError, match=f"hull.toml: model.corio.*{said}"):
            vehicle_from(tree("full", model=model), "hull.toml")
