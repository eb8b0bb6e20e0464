"""Prescribed motions, surroundings, mechanisms and accelerometers obey the textbook, worked out independently."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, oscillator
from scipy.spatial.transform import Rotation

from jaxsub.vehicle import vehicle_from
from jaxsub.vehicle.catalogue import nps_auv_ii

G = 9.80665


def glider(**changes):
    """Surge and heave; pitch and its rate are recorded."""
    data = {
        "schema": 1, "name": "glider", "kind": "submerged-body", "dof": ["surge", "heave"],
        "body": {"mass": 52.0, "weight": 510.0, "buoyancy": 511.0, "speed": 0.3, "reference_density": 1025.0},
        "coefficients": {"X_udot": -3.0, "Z_wdot": -40.0, "X_u": -5.0, "Z_w": -80.0, "Z_q": 2.0, "X_q": 0.5,
                         "X_nn": 0.01},
        "inputs": {"shaft_speed": "n", "thrust": "T"},
        "prescribed": {"theta": "theta", "q": "q"}, "environment": {"density": "rho", "ballast": "V"},
        "outputs": {"w": {"sigma": 0.01}, "depth_rate": {"sigma": 0.01}, "theta": {}, "q": {}},
    }  # fmt: skip
    return vehicle_from(data | changes, "glider.toml")


def test_prescribed_pitch_and_surroundings_drive_surge_and_heave_as_by_hand():
    u, w, z, theta, q, n, T, rho, V = 0.4, -0.1, 20.0, -0.3, 0.05, -8.0, 2.0, 1027.0, 3e-4
    signals = jnp.array([n, T, theta, q, rho, V])
    B = 511.0 * rho / 1025.0 + rho * G * V
    surge = -5.0 * u + 0.5 * q - (510.0 - B) * np.sin(theta) - 0.01 * n**2 + T
    heave = -80.0 * w + (2.0 + 52.0 * 0.3) * q + (510.0 - B) * np.cos(theta)
    vehicle = glider()
    found = vehicle.acceleration(jnp.array([u, w, z]), signals)
    np.testing.assert_allclose(found, [surge / 55.0, heave / 92.0], rtol=1e-13)
    assert vehicle.layout.positions == ("z",)
    shown = vehicle.measure(jnp.zeros(1), jnp.array([[u, w, z]]), signals[None])[0]
    np.testing.assert_allclose(shown, [w, -u * np.sin(theta) + w * np.cos(theta), theta, q], rtol=1e-13)


def test_ballast_and_density_change_buoyancy_by_what_they_displace():
    buoyancy = lambda **around: glider().restoring.buoyancy({name: jnp.asarray(x) for name, x in around.items()})
    base = buoyancy()
    assert base == 511.0
    np.testing.assert_allclose(buoyancy(ballast=2e-4) - base, 1025.0 * G * 2e-4, rtol=1e-9)
    np.testing.assert_allclose(buoyancy(density=1030.0) / base, 1030.0 / 1025.0, rtol=1e-13)
    both = buoyancy(density=1030.0, ballast=-1e-4)
    np.testing.assert_allclose(both, 511.0 * 1030.0 / 1025.0 - 1030.0 * G * 1e-4, rtol=1e-13)


def test_velocity_over_ground_and_euler_rates_are_those_of_a_rotation():
    vehicle = nps_auv_ii()
    state = jnp.array([1.5, 0.3, -0.2, 0.1, -0.3, 0.2, 0.4, -0.5, 1.1, 7.0])
    rates = vehicle.position_rates(vehicle.motion(state, jnp.zeros(3)))
    turn = lambda angles: Rotation.from_euler("ZYX", angles)
    attitude = turn([1.1, -0.5, 0.4])
    np.testing.assert_allclose([rates[a] for a in "xyz"], attitude.apply(np.array(state[:3])), rtol=1e-12)
    h = 1e-6
    moved = [
        np.array([1.1, -0.5, 0.4]) + s * h * np.array([rates[a] for a in ("psi", "theta", "phi")]) for s in (-1, 1)
    ]
    spin = (turn(moved[0]).inv() * turn(moved[1])).as_rotvec() / (2.0 * h)
    np.testing.assert_allclose(spin, state[3:6], rtol=1e-7)


def rotation(angles):
    phi, theta, psi = angles
    c, s = jnp.cos, jnp.sin
    yaw = jnp.array([[c(psi), -s(psi), 0.0], [s(psi), c(psi), 0.0], [0.0, 0.0, 1.0]])
    pitch = jnp.array([[c(theta), 0.0, s(theta)], [0.0, 1.0, 0.0], [-s(theta), 0.0, c(theta)]])
    roll = jnp.array([[1.0, 0.0, 0.0], [0.0, c(phi), -s(phi)], [0.0, s(phi), c(phi)]])
    return yaw @ pitch @ roll


def test_accelerometer_shows_the_second_derivative_of_where_it_is_less_gravity():
    arm, t = jnp.array([0.4, -0.2, 0.1]), 0.7
    angles = lambda t: jnp.array([0.3 * jnp.sin(t), 0.2 * jnp.cos(2.0 * t), 0.5 * t**2])
    centre = lambda t: jnp.array([t**2, jnp.sin(3.0 * t), 0.3 * t**3])
    velocity = lambda t: rotation(angles(t)).T @ jax.jvp(centre, (t,), (1.0,))[1]

    def spin(t):
        cross = rotation(angles(t)).T @ jax.jvp(lambda t: rotation(angles(t)), (t,), (1.0,))[1]
        return jnp.array([cross[2, 1], cross[0, 2], cross[1, 0]])

    place = lambda t: centre(t) + rotation(angles(t)) @ arm
    felt = rotation(angles(t)).T @ (jax.jacfwd(jax.jacfwd(place))(t) - jnp.array([0.0, 0.0, G]))
    outputs = {name: {"sigma": 0.1, "lever_arm": arm.tolist()} for name in ("ax", "ay", "az")}
    data = {"schema": 1, "name": "box", "kind": "submerged-body", "body": {"mass": 2.0}, "outputs": outputs}
    box = vehicle_from(data, "box.toml")
    motion = box.motion(jnp.concatenate([velocity(t), spin(t), angles(t), jnp.zeros(1)]), jnp.zeros(0))
    moving = jnp.concatenate([jax.jacfwd(velocity)(t), jax.jacfwd(spin)(t)])
    motion = dataclasses.replace(motion, accelerations=dict(zip(box.layout.equations, moving, strict=True)))
    found = [box.sensors.show(output, {}, motion) for output in box.layout.outputs]
    np.testing.assert_allclose(found, felt, rtol=1e-10)


def test_accelerometer_at_rest_shows_the_support_of_the_water():
    outputs = {name: {"sigma": 0.1} for name in ("ax", "ay", "az")}
    body = {"mass": 2.0, "weight": 2.0 * G, "buoyancy": 2.0 * G}
    box = vehicle_from(
        {"schema": 1, "name": "box", "kind": "submerged-body", "body": body, "outputs": outputs}, "box.toml"
    )
    shown = box.measure(jnp.zeros(1), jnp.zeros((1, 10)), jnp.zeros((1, 0)))
    np.testing.assert_allclose(shown, [[0.0, 0.0, -G]], atol=1e-12)


def test_mechanism_obeys_its_matrices():
    inertia, friction = np.array([[2.0, 0.3], [0.3, 1.0]]), np.array([[0.5, 0.1], [0.1, 0.2]])
    spring = np.array([[3.0, -1.0], [-1.0, 5.0]])
    rate, place, drive = np.array([0.4, -0.7]), np.array([0.2, 0.1]), 1.5
    expected = np.linalg.solve(inertia, [drive, 0.2] - friction @ rate - spring @ place)
    found = coupled().acceleration(jnp.concatenate([rate, place]), jnp.array([drive]))
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize("vehicle", [oscillator(), glider(), nps_auv_ii()])
def test_methods_take_any_leading_axes(vehicle):
    layout = vehicle.layout
    size, columns = len(layout.equations) + len(layout.positions), len(layout.held) + len(layout.interpolated)
    rng = np.random.default_rng(1)
    states, signals = jnp.asarray(rng.normal(size=(2, 3, size))), jnp.asarray(rng.normal(size=(2, 3, columns)))
    together = vehicle.acceleration(states, signals)
    shown = vehicle.measure(jnp.zeros((2, 3)), states, signals)
    for i, k in np.ndindex(2, 3):
        np.testing.assert_allclose(together[i, k], vehicle.acceleration(states[i, k], signals[i, k]), rtol=1e-12)
        one = vehicle.measure(jnp.zeros(1), states[i, k][None], signals[i, k][None])[0]
        np.testing.assert_allclose(shown[i, k], one, rtol=1e-12)
