"""Whatever a vehicle file holds, it is read as a vehicle that runs, or refused in one line that names the file."""

import copy
import dataclasses
import math
import tomllib
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxsub.effects import options
from jaxsub.errors import InputError
from jaxsub.vehicle import read_vehicle, vehicle_from, vehicle_text

BODY = """
schema = 1
name = "glider"
kind = "submerged-body"
dof = ["surge", "heave", "pitch"]
[body]
mass = { value = 50.0, fixed = false, bounds = [40, inf] }
inertia = [1.0, 9.0, 9.0]
speed = 0.3
length = 2.0
[coefficients]
X_u = -5.0
Z_wdot = { value = -80, fixed = true, prior_std = 3 }
[inputs]
rudder = "delta_r"
[prescribed]
phi = "roll"
[environment]
density = "rho"
[outputs.az]
sigma = 0.1
lever_arm = [0.1, 0, 0.2]
[outputs.theta]
sigma = "estimate"
[[effects]]
effect = "quadratic-damping"
equation = "pitch"
expression = "M_qq |q| q"
parameters = { M_qq = -3.0 }
[[effects]]
effect = "actuator-lag"
actuator = "rudder"
parameters.T = { value = 0.2, bounds = [0, 1] }
[[effects]]
effect = "crossflow-drag"
plane = "vertical"
length = 2
diameter = 0.2
[[effects]]
effect = "coriolis-coupling"
equations = ["surge", "heave"]
[[effects]]
effect = "sensor-bias"
channel = "theta"
"""
RIG = """
schema = 1
name = "rig"
kind = "mechanism"
dof = ["x", "y"]
coefficients = { I_x = 2, I_y = 1, I_x_y = 0.1, K_x = 3, B_x_motor = 1 }
inputs = { motor = "u" }
outputs = { x = { sigma = 0.1 }, y_rate = {} }
effects = [{ effect = "coulomb-friction", equation = "x", smoothing = 0.1 }]
"""
ACTUATED = (Path(__file__).parent / "earlier" / "actuators.toml").read_text(encoding="utf-8")
FILES = pytest.mark.parametrize(
    "text", [BODY, RIG, pytest.param(ACTUATED, marks=pytest.mark.long)], ids=["body", "rig", "actuated"]
)
fuzz = settings(
    derandomize=True, deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def is_read_or_refused(make, name):
    try:
        vehicle = make()
    except InputError as error:
        assert str(error).startswith(name)
        assert len(str(error).splitlines()) == 1
    else:
        runs(vehicle)
        comes_back(vehicle)


def told(vehicle):
    """What is said of each number; one without a prior says nothing by its mean."""
    mean = lambda row: row.prior_mean if math.isfinite(row.prior_std) else 0.0
    return {row.name: dataclasses.replace(row, prior_mean=mean(row)) for row in vehicle.layout.parameters}


def comes_back(vehicle):
    """Raises where the vehicle that its own file describes is another."""
    text = vehicle_text(vehicle)
    again = vehicle_from(tomllib.loads(text), "again.toml")
    assert dataclasses.replace(again.layout, parameters=()) == dataclasses.replace(vehicle.layout, parameters=())
    rows, came = (told(v) for v in (vehicle, again))
    assert {name: row for name, row in came.items() if name in rows} == rows
    # what followed from other numbers is written too
    assert not any(row.free for name, row in came.items() if name not in rows)
    assert [(e.label, options(e)) for e in again.effects] == [(e.label, options(e)) for e in vehicle.effects]
    before, after = vehicle.values(), again.values()
    assert before.keys() == after.keys()
    assert all(float(before[name]) == float(after[name]) for name in before)
    assert vehicle_text(again) == text


def runs(vehicle):
    """Raises where the vehicle cannot be evaluated."""
    layout = vehicle.layout
    state = jnp.zeros((2, len(layout.equations) + len(layout.positions)))
    signals = jnp.zeros((2, len(layout.held) + len(layout.interpolated)))
    nodes = jnp.zeros((1, 3, signals.shape[1]))
    times = jnp.arange(2.0)
    assert jax.eval_shape(vehicle.acceleration, state, signals).shape == (2, len(layout.equations))
    assert jax.eval_shape(vehicle.measure, times, state, signals).shape == (2, len(layout.channels))
    assert jax.eval_shape(vehicle.actuate, times, nodes).shape == nodes.shape


def from_text(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    is_read_or_refused(lambda: read_vehicle(path), str(path))


@fuzz
@given(st.text(max_size=60) | st.binary(max_size=60))
def test_any_text(tmp_path, text):
    from_text(tmp_path / "vehicle.toml", text)


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000, "a = " + "9" * 5000, "schema = 1\nname = 'a'\nkind = [[['mechanism']]]", "a = 1e999"]
)
def test_text_that_strains_a_parser(tmp_path, text):
    from_text(tmp_path / "vehicle.toml", text)


@FILES
@fuzz
@given(
    edits=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 12), st.text('[]{}="\n.,-+ 0129aeXYdot_inf', max_size=4)), max_size=3
    )
)
def test_a_file_with_typing_errors(tmp_path, text, edits):
    for place, cut, typed in edits:
        at = int(place * len(text))
        text = text[:at] + typed + text[at + cut :]
    from_text(tmp_path / "vehicle.toml", text)


numbers = st.floats() | st.integers() | st.sampled_from([0, -1, 1e308, 10**400, float("nan"), float("inf")])
words = st.sampled_from(
    ["", "surge", "pitch", "x", "rudder", "theta", "mechanism", "submerged-body", "density", "X_u", "port", "thruster"]
)
leaves = numbers | st.booleans() | words | st.text(max_size=3) | st.none()
trees = st.recursive(leaves, lambda t: st.lists(t, max_size=3) | st.dictionaries(words, t, max_size=2), max_leaves=5)


def places(data, path=()):
    """The path of everything in a tree of tables and lists."""
    children = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, child in children:
        yield (*path, key)
        yield from places(child, (*path, key))


def with_other_values(text, data):
    """The tree of a file with one or two of its values replaced."""
    tree = tomllib.loads(text)
    for path in data.draw(st.lists(st.sampled_from(list(places(tree))), min_size=1, max_size=2)):
        *above, last = path
        table = tree
        try:
            for key in above:
                table = table[key]
            table[last] = copy.deepcopy(data.draw(trees))
        except (KeyError, IndexError, TypeError):  # an earlier change took the place away
            continue
    return tree


@FILES
@fuzz
@given(data=st.data())
def test_a_file_with_other_values_in_it(text, data):
    tree = with_other_values(text, data)
    is_read_or_refused(lambda: vehicle_from(tree, "vehicle.toml"), "vehicle.toml")


@pytest.mark.long
@FILES
@settings(fuzz, max_examples=10_000)
@given(data=st.data())
def test_many_files_with_other_values_in_them(text, data):
    tree = with_other_values(text, data)
    is_read_or_refused(lambda: vehicle_from(tree, "vehicle.toml"), "vehicle.toml")


def test_a_list_of_names_that_is_none_is_refused():
    """Claim: tables that are made in Python can hold None, which is no list of names, and not an absent key either."""
    tree = tomllib.loads(BODY) | {"effects": [{"effect": "coriolis-coupling", "equations": None}]}
    with pytest.raises(InputError, match=r"equations.*is not a list of names"):
        vehicle_from(tree, "vehicle.toml")


sizes = st.floats(-1e6, 1e6).filter(lambda x: x == 0 or abs(x) > 1e-6)
entries = st.fixed_dictionaries(
    {"value": sizes},
    optional={"fixed": st.booleans(), "prior_std": st.floats(1e-3, 1e3), "bounds": st.just([-math.inf, 2e6])},
) | sizes  # fmt: skip


@settings(fuzz, max_examples=60)
@given(
    numbers=st.dictionaries(st.sampled_from(["X_u", "Z_w", "M_q", "Z_q", "X_0", "Z_delta_r", "M_udot"]), entries),
    mass=st.floats(1e-3, 1e6), arm=st.lists(sizes, min_size=3, max_size=3),
    name=st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=20),
    mean=sizes, free=st.booleans(),
)  # fmt: skip
def test_what_is_written_is_read(numbers, mass, arm, name, mean, free):
    tree = tomllib.loads(BODY)
    tree["coefficients"], tree["name"] = numbers, name
    tree["body"]["mass"] = {"value": mass, "free": free, "prior_std": 2.0, "prior_mean": mean}
    tree["outputs"]["az"]["lever_arm"] = arm
    try:
        vehicle = vehicle_from(tree, "vehicle.toml")
    except InputError as error:
        assert "not positive definite" in str(error)
        return
    rows, values = {row.name: row for row in vehicle.layout.parameters}, vehicle.values()
    assert (vehicle.layout.name, vehicle.layout.outputs[0].lever_arm) == (name, tuple(arm))
    assert (rows["mass"].prior_mean, rows["mass"].prior_std, rows["mass"].free) == (mean, 2.0, free)
    for symbol, entry in numbers.items():
        entry = entry if isinstance(entry, dict) else {"value": entry}
        assert float(values[symbol]) == entry["value"]
        assert rows[symbol].free != entry.get("fixed", False)
        assert rows[symbol].prior_std == entry.get("prior_std", math.inf)
        assert [rows[symbol].lower, rows[symbol].upper] == entry.get("bounds", [-math.inf, math.inf])
    comes_back(vehicle)


def test_that_an_input_has_no_dimension_comes_back():
    """Claim: `unit = ""` is written and read again, unlike no unit, with which an actuator may say it."""
    tree = tomllib.loads(ACTUATED)
    for unit, said in (("", 'm2", unit = ""'), (None, '"m2"')):
        tree["inputs"]["starboard"] = {"column": "m2"} | ({} if unit is None else {"unit": unit})
        vehicle = vehicle_from(tree, "vehicle.toml")
        assert said in vehicle_text(vehicle)
        comes_back(vehicle)
