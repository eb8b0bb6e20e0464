"""Raw channels show what differences of positions in space, the ellipsoid and the sea's equation of state say."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsub.vehicle import recorded_columns, vehicle_from
from jaxsub.vehicle.sensors.earth import radii
from jaxsub.vehicle.sensors.water import depth_at, pressure

G, T, STEP = 9.80665, 0.7, 1e-3
ARM, ASKEW = np.array([0.4, -0.2, 0.3]), np.array([0.1, -0.2, 0.3])
BEAM = np.array([0.5, 0.0, 0.75**0.5])
PLACED = {"sigma": 0.1, "lever_arm": ARM.tolist()}
MOUNTED = PLACED | {"mounting": ASKEW.tolist()}
PORT = np.diag([1.0, -1.0, -1.0])  # from axes forward, starboard and down to forward, port and up
EAST = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # from north, east and down to east, north and up


def place(t):
    return np.array([30.0 + t**2, 20.0 + math.sin(3.0 * t), 5.0 + 0.3 * t**3])


def attitude(t):
    return Rotation.from_euler("ZYX", [0.5 * t**2, 0.2 * math.cos(2.0 * t), 0.3 * math.sin(t)])


def slope(of, t=T):
    """By central differences of fourth order."""
    return (8.0 * (of(t + STEP) - of(t - STEP)) - of(t + 2.0 * STEP) + of(t - 2.0 * STEP)) / (12.0 * STEP)


def velocity(arm, t=T):
    """Of a point of the body, in its axes."""
    return attitude(t).inv().apply(slope(lambda s: place(s) + attitude(s).apply(arm), t))


def turning(t=T):
    spin = attitude(t).as_matrix().T @ slope(lambda s: attitude(s).as_matrix(), t)
    return np.array([spin[2, 1], spin[0, 2], spin[1, 0]])


def shown(outputs, body=None):
    """What the outputs of a body show at the time T of its motion."""
    data = {"schema": 1, "name": "box", "kind": "submerged-body", "body": {"mass": 2.0} | (body or {})}
    box = vehicle_from(data | {"outputs": {"x": {}} | outputs}, "box.toml")
    psi, theta, phi = attitude(T).as_euler("ZYX")
    own = {"phi": phi, "theta": theta, "psi": psi} | dict(zip("xyz", place(T), strict=True))
    state = jnp.asarray([*velocity(np.zeros(3)), *turning(), *(own[name] for name in box.layout.positions)])
    motion = box.motion(state, jnp.zeros(0))
    rates = [*slope(lambda t: velocity(np.zeros(3), t)), *slope(turning)]
    motion = dataclasses.replace(
        motion, accelerations=dict(zip(box.layout.equations, map(jnp.asarray, rates), strict=True))
    )
    channels = box.channels(motion)
    return np.array([float(box.sensors.show(one, channels, motion)) for one in box.layout.outputs[1:]])


@pytest.mark.parametrize(("frame", "axes"), [("FRD", np.eye(3)), ("FLU", PORT)])
def test_instrument_off_the_origin_and_askew(frame, axes):
    """Claim: velocity, rates and specific force of its own place along its own axes are those by finite differences."""
    felt = attitude(T).inv().apply(slope(lambda t: slope(lambda s: place(s) + attitude(s).apply(ARM), t)) - [0, 0, G])
    turned = Rotation.from_euler("ZYX", ASKEW[::-1]).inv()
    expected = [axes @ turned.apply(vector) for vector in (velocity(ARM), turning(), felt)]
    gyro = {key: entry for key, entry in MOUNTED.items() if key != "lever_arm"}
    found = shown({
        "dvl": MOUNTED | {"channel": ["u", "v", "w"], "frame": frame},
        "gyro": gyro | {"channel": ["p", "q", "r"], "frame": frame},
        "acc": MOUNTED | {"channel": ["ax", "ay", "az"], "frame": frame},
    })  # fmt: skip
    np.testing.assert_allclose(found, np.concatenate(expected), rtol=1e-6, atol=1e-6)


def test_beams_are_parts_of_the_velocity_where_the_log_is():
    found = shown({"dvl": MOUNTED | {"channel": "beam", "directions": [[0, 0, 2], BEAM.tolist()]}})
    own = Rotation.from_euler("ZYX", ASKEW[::-1]).inv().apply(velocity(ARM))
    np.testing.assert_allclose(found, [own[2], BEAM @ own], rtol=1e-9)


def test_positions_are_those_of_the_antenna_in_either_frame():
    antenna = place(T) + attitude(T).apply(ARM)
    xyz = {"channel": ["x", "y", "z"]}
    found = shown({"ned": PLACED | xyz, "enu": PLACED | xyz | {"frame": "ENU"}, "cell": PLACED | {"channel": "depth"}})
    np.testing.assert_allclose(found, [*antenna, *EAST @ antenna, antenna[2]], rtol=1e-12)


def test_attitude_east_north_up_is_that_of_the_turned_axes():
    """Claim: Euler angles of axes forward, port and up in axes east, north and up, by their rotation matrix."""
    found = shown({name: {"channel": channel, "frame": "ENU"} for name, channel in zip("abc", ANGLES, strict=True)})
    turned = Rotation.from_matrix(EAST @ attitude(T).as_matrix() @ PORT)
    np.testing.assert_allclose(found, turned.as_euler("ZYX")[::-1], atol=1e-12)


ANGLES = ("phi", "theta", "psi")


def test_scale_and_offset_come_last():
    plain, lined = shown(
        {"a": {"channel": "r", "frame": "FLU"}, "b": {"channel": "r", "frame": "FLU", "scale": 2.0, "offset": 0.3}}
    )
    assert lined == pytest.approx(2.0 * plain + 0.3, abs=1e-14)


def test_heading_is_written_within_its_turn():
    headings = np.array([[-0.1, -0.1], [3.5, 3.5], [6.5, 6.5]])
    data = {"schema": 1, "name": "box", "kind": "submerged-body", "body": {"mass": 2.0}}
    data["outputs"] = {"a": {"channel": "psi", "wrap": "0-360"}, "b": {"channel": "psi", "wrap": "+-180"}}
    found = np.stack([*recorded_columns(vehicle_from(data, "box.toml").layout.outputs, headings).values()], axis=1)
    np.testing.assert_allclose(found, [[2 * np.pi - 0.1, -0.1], [3.5, 3.5 - 2 * np.pi], [6.5 - 2 * np.pi] * 2])


def test_pressure_is_that_of_the_column_of_water_above_the_cell():
    deep = float((place(T) + attitude(T).apply(ARM))[2])
    cell = PLACED | {"channel": "pressure"}
    found = shown({"own": cell, "given": cell | {"density": 1000.0}}, {"reference_density": 1030.0})
    np.testing.assert_allclose(found, [1030.0 * G * deep, 1000.0 * G * deep], rtol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 60.0, 90.0 - 1e-6])
def test_pressure_at_a_latitude_is_unesco_s(degrees):
    """Claim: within 8e-4 of Fofonoff and Millard (1983), whose check value is 9712.653 m at 10 000 dbar and 30°."""
    p = np.array([10.0, 500.0, 2000.0, 6000.0, 10000.0])
    x = math.sin(math.radians(degrees)) ** 2
    gravity = 9.780318 * (1.0 + (5.2788e-3 + 2.36e-5 * x) * x) + 1.092e-6 * p
    depth = (((-1.82e-15 * p + 2.279e-10) * p - 2.2512e-5) * p + 9.72659) * p / gravity
    if degrees == 30.0:
        assert depth[-1] == pytest.approx(9712.653, abs=5e-4)
    np.testing.assert_allclose(pressure(depth, None, math.radians(degrees)), 1e4 * p, rtol=8e-4)
    np.testing.assert_allclose(depth_at(1e4 * p, None, math.radians(degrees)), depth, rtol=8e-4)


def test_pressure_has_the_check_value_of_its_formula():
    """Claim: 7500.00 dbar at 7321.45 m and 30°, as SEAWATER (CSIRO, 1994) states for Saunders's formula."""
    assert pressure(np.array([7321.45]), None, math.radians(30.0))[0] == pytest.approx(7.5e7, abs=100.0)


def test_pressure_has_a_slope_at_any_depth_that_a_search_tries():
    slopes = jax.vmap(jax.grad(lambda z: pressure(z, None, 0.8)))(jnp.array([-50.0, 0.0, 1e3, 1e6]))
    assert np.all(np.isfinite(slopes))
    np.testing.assert_allclose(slopes[:3], 1e4, rtol=0.03)


@pytest.mark.parametrize("latitude", [-0.9, 0.0, 0.6, 1.3])
def test_latitude_and_longitude_are_those_of_the_ellipsoid(latitude):
    """Claim: a kilometre from the origin to 0.3 m of the point on WGS 84 that is so far north and east."""

    def cartesian(lat, lon):
        e = 1.0 / 298.257223563 * (2.0 - 1.0 / 298.257223563)
        n = 6378137.0 / math.sqrt(1.0 - e * math.sin(lat) ** 2)
        return n * np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), (1.0 - e) * math.sin(lat)])

    north, east = radii(latitude)
    moved = cartesian(latitude + 1e3 / north, 0.3 + 500.0 / east) - cartesian(latitude, 0.3)
    axes = [[-math.sin(latitude) * math.cos(0.3), -math.sin(latitude) * math.sin(0.3), math.cos(latitude)],
            [-math.sin(0.3), math.cos(0.3), 0.0]]  # fmt: skip
    np.testing.assert_allclose(np.array(axes) @ moved, [1e3, 500.0], atol=0.3)
    gps = PLACED | {"channel": ["latitude", "longitude"], "origin": [latitude, 0.3]}
    metres = (shown({"gps": gps}) - [latitude, 0.3]) * [north, east]
    np.testing.assert_allclose(metres, (place(T) + attitude(T).apply(ARM))[:2], rtol=1e-9)
