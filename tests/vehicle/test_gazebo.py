"""Gazebo's models in and out, against the equations of its systems as gz-sim 8 has them, written here in NumPy."""

import json
import tomllib
import xml.etree.ElementTree as ET

import jax.numpy as jnp
import numpy as np
import pytest
from commands import ran

from jaxsub.errors import InputError
from jaxsub.vehicle import initial_file, read_sdf, read_vehicle, sdf_text, vehicle_from, vehicle_text
from jaxsub.vehicle.catalogue import bluerov2_heavy, remus_100_nonlinear

HYDRO = 'filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics"'
THRUSTER = 'filename="gz-sim-thruster-system" name="gz::sim::systems::Thruster"'
# the LRAUV of Gazebo's tutorial, with cross-terms, two thrusters and a centre of mass below the origin
TERMS = {
    "xDotU": -4.876161, "yDotV": -126.324739, "zDotW": -126.324739, "kDotP": -0.4, "mDotQ": -33.46, "nDotR": -35.1,
    "yDotR": 3.2, "mDotW": -2.5, "xUabsU": -6.2282, "yVabsV": -601.27, "zWabsW": -601.27, "kPabsP": -0.1916,
    "mQabsQ": -632.698957, "nRabsR": -632.698957, "xU": -1.1, "yV": -2.2, "zW": -3.3, "kP": -0.7, "mQ": -1.9,
    "nR": -2.7, "yR": 0.6, "nV": -0.4, "zUW": -21.0, "mUW": 5.0, "xVR": 2.0, "nVabsR": -3.0, "yRabsV": 1.5, "xWW": 0.3,
}  # fmt: skip
MASS, ABOUT, LOW = 147.8, (3.0, 41.98, 43.1), -0.05
RADIUS, LENGTH, HIGH, RHO, G = 0.15, 2.04, 0.02, 1025.0, 9.81
# place and axis of each thruster's joint in the link's frame, z up
ASTERN = ((-1.04, 0.0, 0.0), (1.0, 0.0, 0.0))
ASIDE = ((0.6, 0.1, 0.2), (0.0, np.sqrt(0.5), np.sqrt(0.5)))
CURVE = 0.004422 * 1000.0 * 0.2**4


def model(more="", terms=TERMS, lump=""):
    said = "".join(f"<{key}>{value}</{key}>" for key, value in terms.items())
    about = "".join(f"<i{axis}{axis}>{value}</i{axis}{axis}>" for axis, value in zip("xyz", ABOUT, strict=True))
    light = "<mass>1e-9</mass><inertia><ixx>1e-12</ixx><iyy>1e-12</iyy><izz>1e-12</izz></inertia>"
    place = " ".join(map(str, ASIDE[0]))
    return f"""<?xml version="1.0"?>
<sdf version="1.9"><world name="sea"><gravity>0 0 -{G}</gravity>
<plugin filename="gz-sim-buoyancy-system"><uniform_fluid_density>{RHO}</uniform_fluid_density></plugin>
<model name="tethys">{more}
<link name="base_link"><pose>0 0 5 0 0 0.3</pose>
<inertial><pose>0 0 {LOW} 0 0 0</pose><mass>{MASS}</mass><inertia>{about}</inertia></inertial>
<collision name="hull"><pose>0 0 {HIGH} 0 1.5708 0</pose>
<geometry><cylinder><radius>{RADIUS}</radius><length>{LENGTH}</length></cylinder></geometry></collision></link>
<link name="propeller"><pose relative_to="base_link">-1.04 0 0 0 {np.pi / 2} 0</pose><inertial>{light}</inertial></link>
<joint name="propeller_joint" type="revolute"><parent>base_link</parent><child>propeller</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<link name="bow"><pose relative_to="base_link">{place} {-np.pi / 4} 0 0</pose><inertial>{light}</inertial></link>
<joint name="bow_joint" type="revolute"><parent>base_link</parent><child>bow</child>
<axis><xyz>0 0 1</xyz></axis></joint>
<plugin {THRUSTER}><joint_name>propeller_joint</joint_name><max_thrust_cmd>30</max_thrust_cmd></plugin>
<plugin {THRUSTER}><joint_name>bow_joint</joint_name><use_angvel_cmd>true</use_angvel_cmd>
<thrust_coefficient>0.004422</thrust_coefficient><propeller_diameter>0.2</propeller_diameter></plugin>
<plugin {HYDRO}><link_name>base_link</link_name>{said}</plugin>{lump}</model></world></sdf>"""


def hydrodynamics(nu, terms=TERMS, carried=True):
    """Force (6,) of `Hydrodynamics.cc`, gz-sim 8, less that of added mass, and that matrix; axes with z up."""
    value = lambda key: float(terms.get(key, 0.0))
    Ma = np.array([[value(f"{f}Dot{v}") for v in "UVWPQR"] for f in "xyzkmn"])
    D = np.zeros((6, 6))
    for i, f in enumerate("xyzkmn"):
        for j, v in enumerate("UVWPQR"):
            D[i, j] = -value(f + v)
            for k, w in enumerate("UVWPQR"):
                D[i, j] -= value(f"{f}{v}abs{w}") * abs(nu[k]) + value(f + v + w) * nu[k]
    a = np.diag(Ma)
    u, v, w, p, q, r = nu
    C = np.array([
        [0, 0, 0, 0, -a[2] * w, -a[1] * v],
        [0, 0, 0, a[2] * w, 0, -a[0] * u],
        [0, 0, 0, -a[1] * v, a[0] * u, 0],
        [0, -a[2] * w, a[1] * v, 0, -a[5] * r, a[4] * q],
        [a[2] * w, 0, -a[0] * u, a[5] * r, 0, -a[3] * p],
        [a[2] * w, a[0] * u, 0, -a[4] * q, a[3] * p, 0],
    ])  # fmt: skip
    return -(D @ nu - carried * C @ nu), Ma


def gazebo(nu, roll, pitch, commands, added=True, **options):
    """Accelerations (6,) of the model in axes with z up, at the attitude of a link in a world with z up."""
    force, Ma = hydrodynamics(nu, **options)
    s = lambda a: np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    c, b = np.array([0.0, 0.0, LOW]), np.array([0.0, 0.0, HIGH])
    about = np.diag(ABOUT) - MASS * s(c) @ s(c)
    M = np.block([[MASS * np.eye(3), -MASS * s(c)], [MASS * s(c), about]])
    momentum = M @ nu
    turned = np.concatenate(
        [np.cross(nu[3:], momentum[:3]), np.cross(nu[3:], momentum[3:]) + np.cross(nu[:3], momentum[:3])]
    )
    R_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    R_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    up = (R_y @ R_x).T @ np.array([0.0, 0.0, 1.0])
    volume = np.pi * RADIUS**2 * LENGTH
    pushes = [(-MASS * G * up, c), (RHO * G * volume * up, b)]
    thrusts = (min(commands[0], 30.0), CURVE * abs(commands[1]) * commands[1])
    pushes += [(t * np.array(axis), np.array(at)) for t, (at, axis) in zip(thrusts, (ASTERN, ASIDE), strict=True)]
    total = force - turned + sum(np.concatenate([f, np.cross(at, f)]) for f, at in pushes)
    return np.linalg.solve(M - added * Ma, total)


FLIP = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def compared(vehicle, **options):
    """The largest difference of accelerations in 20 states, by the largest acceleration."""
    rng, worst, size = np.random.default_rng(3), 0.0, 0.0
    for _ in range(20):
        nu, (roll, pitch) = rng.normal(0.0, [1.5, 0.5, 0.5, 0.5, 0.4, 0.4]), rng.normal(0.0, 0.4, 2)
        commands = rng.normal(0.0, [30.0, 40.0])
        known = dict(zip("uvwpqr", FLIP * nu, strict=True)) | {"phi": roll, "theta": -pitch}
        state = jnp.array([known.get(name, 0.0) for name in vehicle.layout.states])
        ours = np.asarray(vehicle.acceleration(state, jnp.asarray(commands)))
        theirs = FLIP * gazebo(nu, roll, pitch, commands, **options)
        worst, size = max(worst, abs(ours - theirs).max()), max(size, abs(theirs).max())
    return worst / size


@pytest.fixture
def write(tmp_path):
    def made(text, name="model.sdf"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    return made


def test_a_model_moves_as_in_gazebo(write):
    """Claim: accelerations are those of Gazebo's equations to 1e-9, and nothing but the joints is not translated."""
    vehicle, lost = read_sdf(write(model()))
    assert lost == ["joint propeller_joint: taken as fixed", "joint bow_joint: taken as fixed"]
    assert compared(vehicle) < 1e-9
    assert [(item.name, vehicle.layout.input_unit(item.name)) for item in vehicle.actuators.items] == [
        ("propeller", "N"), ("bow", "rad/s"),
    ]  # fmt: skip
    assert vehicle.layout.ties


@pytest.mark.parametrize(("switch", "option"), [("disable_coriolis", "carried"), ("disable_added_mass", "added")])
def test_switches_of_the_plugin_are_heard(write, switch, option):
    """Claim: so it does without Coriolis forces, and without the force of added mass, whose Coriolis forces stay."""
    vehicle, _ = read_sdf(write(model(terms=TERMS | {switch: "true"})))
    assert compared(vehicle, **{option: False}) < 1e-9


def test_what_is_exported_and_imported_again_moves_alike(write):
    """Claim: of our own file, and of the SDF made of it, accelerations are Gazebo's to 1e-9."""
    first, _ = read_sdf(write(model()))
    again = read_vehicle(write(vehicle_text(first), "model.toml"))
    assert compared(again) < 1e-9
    text, lost = sdf_text(again)
    assert lost == []
    world = f'<world name="sea"><gravity>0 0 -{G}</gravity>'
    world += f'<plugin filename="gz-sim-buoyancy-system"><uniform_fluid_density>{RHO}</uniform_fluid_density></plugin>'
    text = text.replace("<model ", f"{world}<model ", 1).replace("</sdf>", "</world></sdf>")
    assert compared(read_sdf(write(text))[0]) < 1e-9


def test_full_coriolis_forces_are_exported_as_quadratic_terms(write):
    """Claim: a BlueROV2 with Fossen's Coriolis forces comes back with its accelerations, thrust apart."""
    vehicle = bluerov2_heavy()
    text, lost = sdf_text(vehicle)
    weight = "body.weight: in Gazebo it is mass times the world's gravity"
    assert lost == [weight, *(f"actuators.t{i}.thrust" for i in range(1, 9))]
    back, _ = read_sdf(write(text))
    nu = jnp.array([0.4, -0.3, 0.2, 0.5, -0.4, 0.3])
    moves = lambda one: one.acceleration(jnp.concatenate([nu, jnp.zeros(len(one.layout.states) - 6)]), jnp.zeros(8))
    assert np.asarray(moves(back)) == pytest.approx(
        np.asarray(moves(vehicle)), rel=1e-3, abs=1e-6
    )  # g is 9.8, not 9.82
    hydro = next(one for one in ET.fromstring(text).iter("plugin") if "hydrodynamics" in one.get("filename"))
    assert hydro.findtext("disable_coriolis") == "true"
    # Munk's moment: (X_udot - Y_vdot) u v in yaw, and z up turns its sign twice
    assert float(hydro.findtext("nUV")) == pytest.approx(-7.12 + 6.36)


def test_what_is_not_translated_is_named(write):
    """Claim: plugins, sensors, includes, meshes and elements that are no derivative are listed, each by its name."""
    fins = '<plugin filename="gz-sim-lift-drag-system"><link_name>fin</link_name></plugin>'
    more = f"<include><uri>fins</uri></include>{fins}"
    mesh = '<link name="dome"><collision name="c"><geometry><mesh/></geometry></collision><sensor name="imu"/></link>'
    text = model(more + mesh, TERMS | {"default_current": "0.1 0 0"})
    text = text.replace("<max_thrust_cmd>", "<deadband>1</deadband><max_thrust_cmd>")
    text = text.replace("<uniform_fluid_density>", "<enable>tethys</enable><uniform_fluid_density>")
    _, lost = read_sdf(write(text))
    assert {
        "hydrodynamics: default_current", "plugin gz-sim-lift-drag-system (fin)", "include fins", "sensor imu",
        "collision dome/c: its volume is unknown", "thruster propeller_joint: deadband",
        "buoyancy: enable",
    } <= set(lost)  # fmt: skip
    _, lost = sdf_text(remus_100_nonlinear())
    assert {"coefficients.X_0", "coefficients.Y_uu_delta_r", "inputs.rudder"} <= set(lost)
    auv = initial_file("auv", {"length": 1.3, "diameter": 0.2, "mass": 30.0}).text()
    _, lost = sdf_text(vehicle_from(tomllib.loads(auv), "auv"))
    assert lost == ["actuators.rudder (fin)", "actuators.stern_plane (fin)"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("<sdf", '<!DOCTYPE sdf [<!ENTITY a "b">]><sdf', 1), "declares a document type"),
        (lambda text: text[:300], "is no XML"),
        (lambda text: text.replace("gz-sim-hydro", "gz-sim-other"), "has no model with a gz-sim-hydrodynamics-system"),
        (lambda text: text.replace("-126.324739", "many", 1), "'many' is not 1 numbers"),
        (lambda text: text.replace("<child>bow<", "<child>stern<"), "names the link 'stern'"),
        (lambda text: text.replace('relative_to="base_link"', 'relative_to="bow"'), "is given relative to itself"),
        (lambda text: "<model/>", "begins with <model>"),
    ],
)
def test_files_that_cannot_be_read_are_refused(write, change, said):
    with pytest.raises(InputError, match=said):
        read_sdf(write(change(model())))


def test_the_commands_say_what_they_leave_out(write, monkeypatch, capsys, tmp_path):
    """Claim: `import` and `export` name what is not translated, and replace no file."""
    path, out, back = write(model()), tmp_path / "v.toml", tmp_path / "back.sdf"
    code, said = ran(monkeypatch, capsys, "import", path, "--out", out, "--json")
    assert code == 0 and json.loads(said.out)["not_translated"][0] == "joint propeller_joint: taken as fixed"
    assert "# Not translated: joint propeller_joint: taken as fixed." in out.read_text()
    code, said = ran(monkeypatch, capsys, "export", out, "--sdf", back)
    assert code == 0 and said.out == f"{back}: all is translated\n"
    assert ran(monkeypatch, capsys, "export", out, "--sdf", back)[0] == 2
