"""`[outputs]` of raw channels: what is refused and how, what is written is read, and old forms are as they were."""

import tomllib

import jax.numpy as jnp
import numpy as np
import pandas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vehicle_texts import RIG

from jaxsub.errors import InputError
from jaxsub.recording import from_pandas
from jaxsub.vehicle import Output, check_units, vehicle_findings, vehicle_from, vehicle_text

TEXT = """
schema = 1
name = "AUV"
kind = "submerged-body"
dof = ["sway", "yaw"]
[body]
mass = 30.5
speed = 1.5
[coefficients]
Y_v = -40.0
N_r = -12.0
N_delta_r = -14.0
[inputs]
rudder = { column = "servo", unit = "rad", scale = -1.0, offset = { value = 0.01, free = true, prior_std = 0.05 } }
[prescribed]
theta = { column = "pitch", scale = -1.0 }
[outputs.gyro]
channel = "r"
column = "gyro_z"
frame = "FLU"
sigma = 0.003
offset = { value = 0.001, free = true, prior_std = 0.02 }
[outputs.dvl]
channel = ["u", "v"]
column = ["vx", "vy"]
sigma = [0.01, "estimate"]
lever_arm = [0.4, 0.0, 0.1]
mounting = [0.0, 0.0, { value = 0.02, free = true, prior_std = 0.1 }]
scale = [1.0, "gyro.offset + 1"]
[outputs.log]
channel = "beam"
column = ["b1", "b2"]
directions = [[0.5, 0.0, 0.8], [-0.5, 0.0, 0.8]]
[outputs.compass]
channel = "psi"
wrap = "0-360"
offset = 0.05
[outputs.cell]
channel = "pressure"
latitude = 0.8
offset = 101325.0
[outputs.pot]
channel = "p"
unit = "V"
scale = { value = 2.0, free = true }
[outputs.gps]
channel = ["latitude", "longitude"]
origin = [0.8, 0.1]
sigma = 1e-7
[outputs.z]
sigma = 0.1
"""
# what is written instead of what, and how the refusal goes on after the name of the file
MISTAKES = {
    "channel": ('channel = "r"', 'channel = "rr"', ": outputs.gyro.channel: unknown key; did you mean r?"),
    "channel of no name": ("[outputs.z]", "[outputs.zz]", ": outputs.zz: unknown key; did you mean z?"),
    "channel a number": ('channel = "r"', "channel = 3", ": outputs.gyro.channel: 3 is not a word"),
    "two kinds": ('["u", "v"]', '["u", "r"]', ": outputs.dvl.channel: no instrument has u and r; name some of one"),
    "channel twice": ('["u", "v"]', '["u", "u"]', ": outputs.dvl.channel: names u twice"),
    "name of a channel": ("[outputs.gyro]", "[outputs.q]", ": outputs.q: is the name of another channel; give the"),
    "name no word": ("[outputs.gyro]", '[outputs."g z"]', ": outputs.g z: is not a word; give the output another"),
    "key": ('frame = "FLU"', 'fram = "FLU"', ": outputs.gyro.fram: unknown key; did you mean frame?"),
    "frame": ('frame = "FLU"', 'frame = "ENU"', ": outputs.gyro.frame: 'ENU' is not known; choose one of FRD, FLU"),
    "frame of a speed": ('channel = "r"', 'channel = "speed"', ": outputs.gyro.frame: speed does not use it; give"),
    "arm of a rate": ("sigma = 0.003", "lever_arm = [1, 0, 0]", ": outputs.gyro.lever_arm: r does not use it; delete"),
    "arm": ("[0.4, 0.0, 0.1]", "[0.4, 0.0]", ": outputs.dvl.lever_arm: is [0.4, 0.0]; give three numbers in m"),
    "mounting": ("[0.0, 0.0, {", "[0.0, {", ": outputs.dvl.mounting: is [0.0, {"),
    "mounting of a heading": ("wrap", "mounting = [0, 0, 1]\nwrap", ": outputs.compass.mounting: psi does not use it"),
    "one column of two": ('["vx", "vy"]', '"vx"', ": outputs.dvl.column: 'vx' is not a list; name 2 columns"),
    "three columns": ('["vx", "vy"]', '["a", "b", "c"]', ": outputs.dvl.column: has 3 entries; give 2, one for each"),
    "column twice": ('["vx", "vy"]', '["vx", "gyro_z"]', ": outputs.dvl: has the column gyro_z of another output"),
    "name twice": ("[outputs.cell]", "[outputs.dvl_u]", ": outputs.dvl_u: has the name dvl_u of another output"),
    "column with unit": ('"gyro_z"', '"gyro_z[deg/s]"', ": outputs.gyro.column: 'gyro_z[deg/s]' has brackets"),
    "sigma": ("0.003", "-0.003", ": outputs.gyro.sigma: is -0.003; give a positive number"),
    "zero scale": ("scale = [1.0,", "scale = [0.0,", ": outputs.dvl.scale: is 0; give"),
    "scale of a heading": ("offset = 0.05", "scale = 1.1", ": outputs.compass.scale: is of a heading, whose turns"),
    "wrap": ('"0-360"', '"0-36"', ": outputs.compass.wrap: '0-36' is not known; did you mean 0-360?"),
    "wrap of a rate": ("sigma = 0.003", 'wrap = "0-360"', ": outputs.gyro.wrap: r does not use it"),
    "unit of an offset": ("value = 0.001", 'unit = "rad", value = 0.001', ": outputs.gyro.offset.unit: is 'rad', and"),
    "unit without scale": ("scale = { value = 2.0, free = true }", "", ": outputs.pot.unit: is 'V', and p is in rad/s"),
    "unit of a scale": ("value = 2.0", 'unit = "V", value = 2.0', ": outputs.pot.scale.unit: is 'V', and the number"),
    "unit not SI": ('unit = "V"', 'unit = "mV"', ": outputs.pot.unit: is 'mV', and numbers of a vehicle file are in"),
    "two waters": ("latitude = 0.8", "latitude = 0.8\ndensity = 1000", ": outputs.cell.latitude: is given beside dens"),
    "latitude in degrees": ("latitude = 0.8", "latitude = 47.0", ": outputs.cell.latitude: is 47; give a latitude"),
    "density of a rate": ("sigma = 0.003", "density = 1000", ": outputs.gyro.density: r does not use it; delete it;"),
    "no origin": ("origin = [0.8, 0.1]", "", ": outputs.gps.origin: is missing; add origin = …"),
    "origin": ("[0.8, 0.1]", "[0.8]", ": outputs.gps.origin: is [0.8]; give latitude and longitude in rad"),
    "no directions": ("directions = [[0.5, 0.0, 0.8], [-0.5, 0.0, 0.8]]", "", ": outputs.log.directions: is missing"),
    "direction": ("[[0.5, 0.0, 0.8]", "[[0.0, 0.0, 0.0]", ": outputs.log.directions: has no length; give a direct"),
    "tie": ("gyro.offset + 1", "gyro.ofset + 1", ": outputs.dvl_v.scale: follows gyro.ofset, which is no number"),
    "key of an input": ("offset = { value = 0.01", "ofset = { value = 0.01", ": inputs.rudder.ofset: unknown key; did"),
    "key of a prescribed motion": ('"pitch", scale', '"pitch", unit', ": prescribed.theta.unit: unknown key; known:"),
    "scale of an input": ("scale = -1.0, offset", "scale = 0.0, offset", ": inputs.rudder.scale: is 0; give what one"),
    "offset said twice": ("[outputs.z]", '[[effects]]\neffect = "sensor-bias"\nchannel = "gryo"\n[outputs.z]',
                          ": effects[1] (sensor-bias): no channel gryo; use gyro"),
}  # fmt: skip


def auv(text=TEXT):
    return vehicle_from(tomllib.loads(text), "auv.toml")


def written(vehicle):
    return vehicle_from(tomllib.loads(vehicle_text(vehicle)), "written.toml")


@pytest.mark.parametrize("case", MISTAKES)
def test_refused_in_one_line_that_says_where_and_what_to_do(case):
    old, new, said = MISTAKES[case]
    assert old in TEXT
    with pytest.raises(InputError) as refused:
        auv(TEXT.replace(old, new, 1))
    assert str(refused.value).startswith("auv.toml" + said)
    assert "\n" not in str(refused.value)


def test_what_is_written_is_read():
    """Claim: outputs, free numbers with their priors, values and ties are the same to the last digit."""
    vehicle = auv()
    again = written(vehicle)
    assert again.layout.outputs == vehicle.layout.outputs
    assert again.layout.free == vehicle.layout.free
    assert again.layout.ties == vehicle.layout.ties
    assert {name: float(one) for name, one in again.values().items()} == {
        name: float(one) for name, one in vehicle.values().items()
    }
    assert vehicle_text(again) == vehicle_text(vehicle)


def test_names_columns_and_units_of_outputs():
    layout = auv().layout
    assert layout.channels == (
        "gyro", "dvl_u", "dvl_v", "log_1", "log_2", "compass", "cell", "pot", "gps_latitude", "gps_longitude", "z",
    )  # fmt: skip
    assert layout.columns[:5] == ("gyro_z", "vx", "vy", "b1", "b2")
    assert layout.columns[5:] == layout.channels[5:]
    units = [layout.unit(name) for name in ("gyro", "cell", "pot", "gps_latitude")]
    assert units == ["rad/s", "Pa", "V", "rad"]
    assert [row.unit for row in layout.free if "." in row.name] == ["rad", "rad/s", "rad", "V/(rad/s)"]
    assert layout.positions == ("psi", "x", "y", "z")


def test_plain_outputs_are_as_they_were():
    """Claim: a file with no new key has outputs of its channels' names, columns and units, and no number more."""
    vehicle = auv(TEXT[: TEXT.index("[outputs.gyro]")] + "[outputs.r]\n")
    assert vehicle.layout.outputs == (Output("r"),)
    assert (vehicle.layout.columns, vehicle.layout.unit("r")) == (("r",), "rad/s")


def test_a_column_of_another_dimension_is_refused_by_its_own_name():
    table = {"t": [0.0, 1.0], "servo": [0.0, 0.0], "pitch": [0.0, 0.0], "cell[m]": [1.0, 2.0]}
    with pytest.raises(InputError) as refused:
        check_units(auv().layout, [from_pandas(pandas.DataFrame(table), "run")])
    assert str(refused.value) == (
        "run, column 'cell': metre is not the unit of a pressure; head it cell[…] in Pa, kPa or dbar"
    )
    check_units(auv().layout, [from_pandas(pandas.DataFrame(table).rename(columns={"cell[m]": "cell[dbar]"}), "run")])


def test_an_acceleration_in_g_under_another_name_is_told_how_to_say_it():
    layout = auv(TEXT.replace('channel = "r"', 'channel = "ax"')).layout
    table = {"t": [0.0, 1.0], "servo": [0.0, 0.0], "pitch": [0.0, 0.0], "gyro_z[g]": [1.0, 2.0]}
    with pytest.raises(
        InputError, match=r"kilogram is not the unit of an acceleration; head it gyro_z\[…\] in m/s\^2 or g_n"
    ):
        check_units(layout, [from_pandas(pandas.DataFrame(table), "run")])
    table["gyro_z[g_n]"] = table.pop("gyro_z[g]")
    check_units(layout, [from_pandas(pandas.DataFrame(table), "run")])


def test_recorded_columns_of_inputs_and_prescribed_motions_are_undone():
    """Claim: a rudder's column is -δ + 0.01 and a pitch's -θ, and outputs and steps have δ and θ."""
    vehicle = auv()
    nodes = np.zeros((4, 3, 3))
    nodes[..., 0], nodes[..., 1] = -0.2 + 0.01, 0.3
    true = vehicle.actuate(jnp.arange(5.0), jnp.asarray(nodes))
    np.testing.assert_allclose(true[..., 0], 0.2, atol=1e-15)
    motion = vehicle.motion(jnp.zeros(len(vehicle.layout.states)), true[0, 0])
    assert float(motion.positions["theta"]) == pytest.approx(-0.3)
    assert float(motion.actuators["rudder"]) == pytest.approx(0.2)


def test_mechanism_has_scale_offset_and_unit_and_no_more():
    """Claim: a rig's potentiometer in volts is read and written; what only a body has is refused."""
    pot = 'outputs.pot = { channel = "x", unit = "V", scale = { value = 2.0, free = true } }\n'
    text = RIG.replace("outputs.x_rate", f"{pot}outputs.x_rate")
    rig = vehicle_from(tomllib.loads(text), "rig.toml")
    assert "pot.scale" in [row.name for row in rig.layout.free]
    assert written(rig).layout.outputs == rig.layout.outputs
    for key in ('frame = "FLU"', "density = 3", "mounting = [0, 0, 0]"):
        with pytest.raises(InputError, match="x does not use it; delete it"):
            vehicle_from(tomllib.loads(text.replace('unit = "V"', key)), "rig.toml")


def test_an_effect_beside_a_free_number_is_said_twice():
    text = TEXT + '[[effects]]\neffect = "sensor-bias"\nchannel = "gyro"\n'
    vehicle = auv(text)
    assert [row.unit for row in vehicle.layout.free if row.name == "sensor-bias[gyro].bias"] == ["rad/s"]
    (found,) = [one for one in vehicle_findings(vehicle, "auv.toml") if one.check == "said-twice"]
    assert "the coefficient gyro.offset" in found.what
    assert not any(one.check == "said-twice" for one in vehicle_findings(auv(text.replace("free", "fixed", 2)), ""))


ENTRIES = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 400) | st.floats() | st.text(max_size=5)
    | st.sampled_from(["r", "psi", "ENU", "0-360", "one.offset", "m/s"]),
    lambda below: st.lists(below, max_size=4)
    | st.dictionaries(st.sampled_from(["value", "free", "unit", "a"]), below, max_size=3),
    max_leaves=6,
)  # fmt: skip
KEYS = st.sampled_from(
    ["channel", "column", "unit", "sigma", "scale", "offset", "lever_arm", "mounting", "frame", "wrap", "density",
     "latitude", "origin", "directions", "other"]
)  # fmt: skip
CHANNELS = ["r", "u", ["u", "v"], "psi", "pressure", "beam", ["latitude", "longitude"], "ax", "depth", "speed"]


def read_or_refused(data):
    """The vehicle of a file; None where it is refused in one line that begins with the file."""
    try:
        return vehicle_from(data, "auv.toml")
    except InputError as refused:
        assert str(refused).startswith("auv.toml: ") and "\n" not in str(refused)
        return None


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(CHANNELS), st.dictionaries(KEYS, ENTRIES, max_size=4))
def test_any_table_is_read_and_written_or_refused_in_one_line(channel, entries):
    """Claim: no table of an output ends in another error, and what is accepted is read back as it was."""
    data = tomllib.loads(TEXT)
    data["outputs"] = {"one": {"channel": channel} | entries, "z": {}}
    if (vehicle := read_or_refused(data)) is None:
        return
    again = written(vehicle)
    assert again.layout.outputs == vehicle.layout.outputs
    assert again.layout.free == vehicle.layout.free


@settings(max_examples=100, deadline=None)
@given(
    st.sampled_from([("inputs", "rudder"), ("prescribed", "theta")]),
    st.dictionaries(st.sampled_from(["unit", "scale", "offset", "other"]), ENTRIES, max_size=3),
)
def test_any_column_of_an_input_is_read_and_written_or_refused_in_one_line(place, entries):
    """Claim: the same of the columns of inputs and prescribed motions."""
    section, name = place
    data = tomllib.loads(TEXT)
    data[section][name] = {"column": "c"} | entries
    if (vehicle := read_or_refused(data)) is None:
        return
    again = written(vehicle)
    assert again.layout.free == vehicle.layout.free
    assert (again.layout.inputs, again.layout.prescribed) == (vehicle.layout.inputs, vehicle.layout.prescribed)


def test_a_number_moves_what_follows_it_and_no_output():
    """Claim: a scale that follows an offset moves with it; the outputs stay, and so does an offset that is held."""
    vehicle = auv().with_values({"gyro.offset": np.asarray(0.5)})
    assert float(vehicle.values()["dvl_v.scale"]) == 1.5
    assert float(vehicle.holding(["gyro.offset"]).values()["gyro.offset"]) == 0.5
    assert vehicle.layout == auv().layout
