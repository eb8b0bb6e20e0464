"""`[actuators]` and `[inputs]` of any name: what is refused and how, curves in files, units, and ties."""

import copy
import tomllib

import jax.numpy as jnp
import numpy as np
import pandas
import pytest
from vehicle_texts import RIG

from jaxsub.effects import ActuatorLag, ActuatorRateLimit, ActuatorSaturation, ThrusterCrossCoupling
from jaxsub.errors import InputError
from jaxsub.recording import from_pandas
from jaxsub.vehicle import check_units, read_vehicle, vehicle_findings, vehicle_from, vehicle_text, with_coefficients

TEXT = """
schema = 1
name = "ROV"
kind = "submerged-body"
dof = ["surge", "sway", "yaw"]
[body]
mass = 13.5
inertia = [0.26, 0.23, 0.37]
[coefficients]
X_u = -14.0
B_yaw_trim = 0.4
[inputs]
port = "u1"
starboard = "u2"
trim = { column = "u3", unit = "V" }
tail = "u4"
shaft = "u5"
[actuators.port]
kind = "thruster"
position = [0.1, -0.2, 0.0]
direction = [1.0, 0.0, 0.0]
forward = { value = 2.0, free = true, bounds = [0.0, 9.0] }
reverse = 1.5
dead_band = 0.1
time_constant = 0.2
[actuators.starboard]
kind = "thruster"
position = [0.1, 0.2, 0.0]
direction = [1.0, 0.0, 0.0]
thrust = { command = [-1.0, 0.0, 1.0], thrust = [-30.0, 0.0, 40.0] }
gain = "port.forward / 2"
[actuators.tail]
kind = "fin"
position = [-0.5, 0.0, 0.0]
direction = [0.0, 1.0, 0.0]
area = 0.01
lift_slope = 3.0
[actuators.screw]
kind = "propeller"
input = "shaft"
position = [-0.5, 0.0, 0.0]
diameter = 0.2
K_T = [0.3, -0.2]
[outputs.r]
sigma = 0.01
"""
# what is written instead of what, and how the refusal goes on after the name of the file
MISTAKES = {
    "kind": ('"thruster"', '"thrster"', ": actuators.port.kind: 'thrster' is not known; did you mean thruster?"),
    "key": ("forward =", "foward =", ": actuators.port.foward: unknown key; did you mean forward?"),
    "key of another kind": ("dead_band = 0.1", "area = 2", ": actuators.port.area: unknown key; known: kind, input,"),
    "no position": ("position = [0.1, -0.2, 0.0]", "", ": actuators.port.position: is missing; add position = …"),
    "two numbers": ("[0.1, -0.2, 0.0]", "[0.1, -0.2]", ": actuators.port.position: is [0.1, -0.2]; give three"),
    "no direction": ("[1.0, 0.0, 0.0]", "[0.0, 0.0, 0.0]", ": actuators.port.direction: has no length; give a dir"),
    "fin ahead": ("[0.0, 1.0, 0.0]", "[0.5, 1.0, 0.0]", ": actuators.tail.direction: has a part ahead"),
    "no command": ('port = "u1"\n', "", ": actuators.port.input: port is not under [inputs]; write port"),
    "other command": ('"shaft"', '"shft"', ": actuators.screw.input: shft is not under [inputs]; did you mean shaft?"),
    "input": ('input = "shaft"', "input = 3", ": actuators.screw.input: is 3; write input = "),
    "no such actuator": ('tail = "u4"', 'tail = "u4"\ntial = "u6"', ": inputs.tial: unknown key; did you mean tail?"),
    "taken name": ('tail = "u4"', 'tail = "u4"\npsi = "u6"', ": inputs.psi: is the name of a motion"),
    "no word": ('tail = "u4"', 'tail = "u4"\n"a b" = "u6"', ": inputs.a b: is not a word"),
    "unit not SI": ('unit = "V"', 'unit = "mV"', ": inputs.trim.unit: is 'mV', and numbers of a vehicle file are"),
    "no unit": ('unit = "V"', 'unit = "vlt"', ": inputs.trim.unit: unknown unit 'vlt'"),
    "no column": ('{ column = "u3", unit', "{ unit", ": inputs.trim.column: is missing; add column = …"),
    "key of an input": ('"u3", unit', '"u3", units', ": inputs.trim.units: unknown key; did you mean unit?"),
    "unit of a fin": ('tail = "u4"', 'tail = { column = "u4", unit = "V" }', ": actuators.tail.input: tail is in V"),
    "unit of a rudder": ('tail = "u4"', 'tail = "u4"\nrudder = { column = "u6", unit = "V" }', ": inputs.rudder.unit"),
    "reverse alone": ("forward = {", "advance = {", ": actuators.port.reverse: is given without forward"),
    "two curves": ("gain =", "forward =", ": actuators.starboard.thrust: is given beside forward"),
    "reversed table": ("[-1.0, 0.0, 1.0]", "[1.0, 0.0, -1.0]", ": actuators.starboard.thrust: command does not incr"),
    "short table": ("[-1.0, 0.0, 1.0]", "[-1.0, 1.0]", ": actuators.starboard.thrust: has 2 command and 3 thrust"),
    "word in a table": ("[-1.0, 0.0,", '[-1.0, "0",', ": actuators.starboard.thrust.command: '0' is not a finite"),
    "key of a table": ("{ command =", "{ commnd =", ": actuators.starboard.thrust.commnd: unknown key; did you mean"),
    "no such file": ("{ command = [-1.0, 0.0, 1.0], thrust = [-30.0, 0.0, 40.0] }", '"t200.csv"',
                     ": actuators.starboard.thrust: 't200.csv' is no file"),
    "tie to nothing": ("port.forward / 2", "port.forwrd / 2", ": actuators.starboard.gain: follows port.forwrd, which"),
    "no slope": ("lift_slope = 3.0", "", ": actuators.tail.lift_slope: is missing; add area and lift_slope, or"),
    "both slopes": ("area = 0.01", "derivative = 3.0", ": actuators.tail.lift_slope: is given beside derivative"),
    "negative area": ("area = 0.01", "area = -0.01", ": actuators.tail.area: is -0.01; give a positive number"),
    "unit of an area": ("area = 0.01", 'area = { value = 0.01, unit = "m" }', ": actuators.tail.area.unit: is 'm'"),
    "no diameter": ("diameter = 0.2", "", ": actuators.screw.diameter: is missing"),
    "no coefficients": ("K_T = [0.3, -0.2]", "K_T = []", ": actuators.screw.K_T: has 0 coefficients; give 1 to 20"),
    "wake of a drift": ("diameter = 0.2", "diameter = 0.2\nC_1 = 2.0", ": actuators.screw.C_2: is missing beside C_1"),
    "limits": ("dead_band = 0.1", "limits = [1.0, -1.0]", ": actuators.port.limits: is [1.0, -1.0]; write limits = "),
    "lag": ("time_constant = 0.2", "time_constant = -0.2", ": actuators.port.time_constant: value -0.2 lies outside"),
    "lag of a sum": ("time_constant = 0.2", "time_constant = 0.2\ninput = { port = 1.0, starboard = 1.0 }",
                     ": actuators.port.time_constant: acts on a command of 2 inputs; give each of them"),
    "lag twice": ("[outputs.r]", '[[effects]]\neffect = "actuator-lag"\nactuator = "port"\n[outputs.r]',
                  ": effects[2] (actuator-lag): actuator-lag[port] is there twice"),
    "outside bounds": ("bounds = [0.0, 9.0]", "bounds = [3.0, 9.0]", ": actuators.port.forward: value 2 lies outside"),
    "no such input of a coefficient": ("B_yaw_trim", "B_yaw_trm", ": inputs.trim: unknown key"),
    "no propeller": ('kind = "fin"', 'kind = "rudder"\npropeller = "port"', ": actuators.tail.direction: unknown key"),
}  # fmt: skip


def rov(text=TEXT):
    return vehicle_from(tomllib.loads(text), "rov.toml")


@pytest.mark.parametrize("case", MISTAKES)
def test_refused_in_one_line_that_says_where_and_what_to_do(case):
    old, new, said = MISTAKES[case]
    assert old in TEXT
    with pytest.raises(InputError) as refused:
        rov(TEXT.replace(old, new, 1))
    assert str(refused.value).startswith(f"rov.toml{said}"), str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_rudder_needs_a_propeller_that_is_one():
    rudder = '[actuators.tail]\nkind = "rudder"\nposition = [-0.5, 0, 0]\npropeller = "port"\narea = 1\nlift_slope = 3'
    with pytest.raises(
        InputError, match=r"rov.toml: actuators.tail.propeller: 'port' is no propeller of \[actuators\]"
    ):
        rov(TEXT[: TEXT.index("[actuators.tail]")] + rudder + TEXT[TEXT.index("\n[actuators.screw]") :])


def test_a_mechanism_has_none():
    with pytest.raises(InputError, match="actuators: is a part of a submerged body"):
        vehicle_from(tomllib.loads(RIG) | {"actuators": {"motor": {"kind": "generic"}}}, "rig.toml")


def leaves(tree, path=()):
    """Every number, word and flag of `[inputs]` and `[actuators]`, by the keys that lead there."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, dict | list):
            yield from leaves(value, (*path, key))
        else:
            yield (*path, key)


PLACES = [path for path in leaves(tomllib.loads(TEXT)) if path[0] in ("inputs", "actuators")]


@pytest.mark.parametrize("path", PLACES, ids=str)
def test_no_entry_is_ignored(path):
    """Claim: whatever is written in its place changes the file that is written of the vehicle, or is refused."""
    before, tree = vehicle_text(rov()), tomllib.loads(TEXT)
    *above, last = path
    table = tree
    for key in above:
        table = table[key]
    was = table[last]
    # a direction is made one of unit length
    other = -was - 0.3 if isinstance(was, float) else f"{was}x"
    table[last] = not was if isinstance(was, bool) else other
    try:
        assert vehicle_text(vehicle_from(copy.deepcopy(tree), "rov.toml")) != before
    except InputError as error:
        assert str(error).startswith("rov.toml")


def test_numbers_are_the_vehicle_s_and_fixed_unless_the_file_frees_them():
    vehicle = rov()
    rows = {row.name: row for row in vehicle.layout.parameters}
    assert [row.name for row in vehicle.layout.free] == ["X_u", "B_yaw_trim", "port.forward"]
    assert (rows["port.forward"].lower, rows["port.forward"].upper) == (0.0, 9.0)
    assert rows["B_yaw_trim"].unit == "N*m/(V)"
    assert rows["screw.K_T_0"].unit == "1"
    assert rows["actuator-lag[port].T"].unit == "s"
    moved = vehicle.with_values({"port.forward": jnp.asarray(5.0)}).values()
    assert float(moved["starboard.gain"]) == 2.5


def test_time_constant_may_follow_another():
    """Claim: a common lag is one free number, in the vehicle's effects, after a fit's values and in the file."""
    text = TEXT.replace("time_constant = 0.2", "time_constant = { value = 0.2, free = true }")
    vehicle = rov(text.replace('gain = "port', 'time_constant = "2 * port.time_constant"\ngain = "port'))
    assert [row.name for row in vehicle.layout.free][-1] == "actuator-lag[port].T"
    assert float(vehicle.values()["actuator-lag[starboard].T"]) == pytest.approx(0.4)
    moved = vehicle.with_values({"actuator-lag[port].T": jnp.asarray(0.5)})
    assert float(moved.values()["actuator-lag[starboard].T"]) == 1.0
    again = vehicle_from(tomllib.loads(vehicle_text(moved)), "again.toml")
    assert vehicle_text(again) == vehicle_text(moved)
    assert 'time_constant = "2 * port.time_constant"' in vehicle_text(moved)
    with pytest.raises(InputError, match=r"actuators.starboard.time_constant: follows port.rate_limit, which is no nu"):
        rov(text.replace('gain = "port', 'time_constant = "port.rate_limit"\ngain = "port'))


def test_curve_in_a_file_is_converted_by_its_header(tmp_path):
    """Claim: a bench test in kgf and per cent is the table in N and parts of one, wherever the columns stand."""
    (tmp_path / "bench.csv").write_text("volts,thrust[kgf],command[%]\n12,-3.0,-100\n12,0.0,0\n12,4.0,100\n")
    inline = "{ command = [-1.0, 0.0, 1.0], thrust = [-30.0, 0.0, 40.0] }"
    (tmp_path / "rov.toml").write_text(TEXT.replace(inline, '"bench.csv"'))
    vehicle = read_vehicle(tmp_path / "rov.toml")
    points = vehicle.actuators.items[1].thrust
    np.testing.assert_allclose(points, ([-1.0, 0.0, 1.0], [-29.41995, 0.0, 39.2266]), rtol=1e-12)
    written = tomllib.loads(vehicle_text(vehicle))["actuators"]["starboard"]["thrust"]
    np.testing.assert_allclose(written["thrust"], points[1], rtol=1e-15)


BENCHES = {
    "no column": ("command,force\n1,2\n", "bench.csv: has no column thrust; head one thrust[N]"),
    "empty": ("", "bench.csv: has no column command; head one command["),
    "word": ("command,thrust\n0,0\n1,much\n", "bench.csv, column 'thrust': holds what is no number; give a number in"),
    "unit": ("command,thrust[V]\n0,0\n1,1\n", "bench.csv, column 'thrust': is in V; give it in N"),
    "unknown": ("command,thrust[nwt]\n0,0\n1,1\n", "bench.csv, column 'thrust': unknown unit 'nwt'"),
}


@pytest.mark.parametrize("case", BENCHES)
def test_bad_file_of_a_curve_is_refused_by_name(tmp_path, case):
    text, said = BENCHES[case]
    (tmp_path / "bench.csv").write_text(text)
    inline = "{ command = [-1.0, 0.0, 1.0], thrust = [-30.0, 0.0, 40.0] }"
    (tmp_path / "rov.toml").write_text(TEXT.replace(inline, '"bench.csv"'))
    with pytest.raises(InputError) as refused:
        read_vehicle(tmp_path / "rov.toml")
    assert said in str(refused.value), str(refused.value)


def run(**columns):
    """A run of two samples, headed as in a file: `u3="V"`."""
    table = {f"{name}[{unit}]": [0.1, 0.2] for name, unit in columns.items()}
    return from_pandas(pandas.DataFrame({"t": [0.0, 1.0]} | table), "run")


def test_columns_are_taken_in_the_unit_of_their_actuator():
    """Claim: volts where the file says so, angles of a fin, shaft speeds in rpm, anything where it does not say."""
    layout = rov().layout
    assert [layout.input_unit(name) for name, _ in layout.inputs] == ["", "", "V", "rad", "rad/s"]
    check_units(layout, [run(u1="V", u2="pct", u3="mV", u4="deg", u5="rpm", r="deg/s")])
    for column, unit, said in (("u3", "N", "volt"), ("u4", "V", "an angle"), ("u5", "V", "an angular rate")):
        with pytest.raises(InputError, match=f"run, column '{column}'.*{said}"):
            check_units(layout, [run(**{column: unit})])


def test_unit_of_a_mechanism_s_input_is_checked_too():
    """Claim: also of an input named as one of a body, and the file that is written states it."""
    tree = tomllib.loads(RIG) | {"inputs": {"thrust": {"column": "u", "unit": "V"}}}
    tree["coefficients"] = {"I_x": 2.0, "K_x": 3.0, "B_x_thrust": 1.0}
    vehicle = vehicle_from(tree, "rig.toml")
    assert 'thrust = {column = "u", unit = "V"}' in vehicle_text(vehicle)
    check_units(vehicle.layout, [run(u="mV", x="m")])
    with pytest.raises(InputError, match="run, column 'u': newton is not the unit of a quantity in volt"):
        check_units(vehicle.layout, [run(u="N", x="m")])


def test_accepted_stage_is_written_as_the_key_of_its_actuator():
    """Claim: a rate limit before the file's lag stays an effect, a lag after its rate limit becomes the key; both move
    the vehicle as before when read back."""
    limited = TEXT.replace("time_constant = 0.2", "rate_limit = 3.0")
    late = rov(limited).with_effect(ActuatorLag("port", jnp.asarray(0.3)))
    table = tomllib.loads(vehicle_text(late))["actuators"]["port"]
    assert table["time_constant"] == {"value": pytest.approx(0.3), "fixed": False}
    early = rov().with_effect(ActuatorRateLimit("port", jnp.asarray(3.0)))
    tree = tomllib.loads(vehicle_text(early))
    assert "rate_limit" not in tree["actuators"]["port"]
    assert [entry["effect"] for entry in tree["effects"]] == ["actuator-rate-limit"]
    curved = rov(limited).with_effect(ActuatorSaturation("port", jnp.asarray(0.5)))
    curved = curved.with_effect(ActuatorLag("port", jnp.asarray(0.3)))
    assert len(tomllib.loads(vehicle_text(curved))["effects"]) == 2
    times, nodes = jnp.arange(6.0), jnp.asarray(np.random.default_rng(1).normal(size=(5, 1, 5)) * np.ones((1, 3, 1)))
    for vehicle in (late, early, curved):
        again = vehicle_from(tomllib.loads(vehicle_text(vehicle)), "again.toml")
        assert vehicle_text(again) == vehicle_text(vehicle)
        np.testing.assert_allclose(again.actuate(times, nodes), vehicle.actuate(times, nodes), rtol=1e-12)


def test_accepted_coupling_of_a_thruster_is_written_as_its_coefficient():
    written = with_coefficients(rov().with_effect(ThrusterCrossCoupling("sway", "port", jnp.asarray(0.7))))
    assert written.effects == rov().effects
    assert float(written.values()["B_sway_port"]) == pytest.approx(0.7)
    assert "B_sway_port = {value = 0.7" in vehicle_text(written)


def test_an_input_whose_actuator_acts_on_locked_motions_is_reported():
    text = TEXT.replace("direction = [0.0, 1.0, 0.0]", "direction = [0.0, 0.0, 1.0]")
    found = [one.where for one in vehicle_findings(rov(text), "rov.toml") if one.check == "idle-input"]
    assert found == ["rov.toml: inputs.tail"]


def test_a_coefficient_beside_an_actuator_of_the_same_input_and_equation_is_reported():
    text = TEXT.replace("B_yaw_trim = 0.4", "B_yaw_trim = 0.4\nB_yaw_port = 0.1\nB_sway_port = 0.2")
    found = {one.where: one.what for one in vehicle_findings(rov(text), "rov.toml") if one.check == "said-twice"}
    assert list(found) == ["rov.toml: coefficients.B_yaw_port"]
    assert "[actuators.port]" in found["rov.toml: coefficients.B_yaw_port"]
