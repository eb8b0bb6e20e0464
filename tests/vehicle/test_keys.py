"""No key of a vehicle file is ignored: whatever is written in its place changes the vehicle or is refused."""

import copy
import math
import tomllib

import pytest
from test_reader_fuzz import BODY, RIG, places

from jaxsub.effects import options
from jaxsub.errors import InputError
from jaxsub.vehicle import SubmergedBody, vehicle_findings, vehicle_from

# one that has every key of a number
NUMBER = {"value": -60.0, "fixed": False, "bounds": [-100.0, 0.0], "prior_std": 3.0, "prior_mean": -50.0}
EXTRA = {"weight": 500.0, "buoyancy": 499.0, "centre_of_buoyancy": [0.0, 0.1, -0.1], "diameter": 0.3,
         "reference_density": 1000.0}  # fmt: skip


def trees():
    """Parsed vehicle files that together have every key the reader knows."""
    body, rig = tomllib.loads(BODY), tomllib.loads(RIG)
    body["body"] |= copy.deepcopy(EXTRA)
    body["geometry"] = {"kind": "rov", "length": 2.0, "mass": 50.0, "beam": 0.5, "height": 0.4, "density": 1000.0}
    body["coefficients"]["X_u"] = copy.deepcopy(NUMBER)
    body["coefficients"]["M_q"] = {"value": -3.0, "free": False, "unit": "N*m/(rad/s)"}
    rig["coefficients"]["D_x"] = {"value": 1.0, "unit": "N s/m"}
    rig["environment"] = {"wind": "w"}
    return {"body": body, "rig": rig}


def fingerprint(tree):
    """All that a vehicle is."""
    vehicle = vehicle_from(copy.deepcopy(tree), "vehicle.toml")
    density = vehicle.restoring.reference_density if isinstance(vehicle, SubmergedBody) else None
    effects = [(effect.name, sorted(options(effect).items())) for effect in vehicle.effects]
    return {name: float(value) for name, value in vehicle.values().items()}, vehicle.layout, effects, density


def others(value):
    """What may be written instead of `value`."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float):
        return [1.03 * value + 0.001 if math.isfinite(value) else 99.0, "a word"]
    if isinstance(value, str):
        return [f"{value}s", *{"heave", "theta"} - {value}, 3]
    return [3]


LEAVES = [
    (kind, path)
    for kind, tree in trees().items()
    for path in places(tree)
    if not isinstance(path[-1], int) or not isinstance(path[-2], int)
]


@pytest.mark.parametrize(("kind", "path"), LEAVES, ids=str)
def test_other_value_of_a_key_changes_the_vehicle_or_is_refused(kind, path):
    tree = trees()[kind]
    before = fingerprint(tree)
    *above, last = path
    table = tree
    for key in above:
        table = table[key]
    was = table[last]
    if isinstance(was, dict | list):
        was = None
    changed = 0
    for value in others(was):
        table[last] = value
        try:
            assert fingerprint(tree) != before, f"{path} = {value!r} is ignored"
            changed += 1
        except InputError as error:
            assert str(error).startswith("vehicle.toml")
    # a number of the vehicle can be changed; only what says again what is known already cannot
    if isinstance(was, float):
        assert changed


@pytest.mark.parametrize("kind", ["body", "rig"])
def test_key_that_nobody_knows_is_refused_everywhere(kind):
    for path in [(), *places(trees()[kind])]:
        tree = trees()[kind]
        table = tree
        for key in path:
            table = table[key]
        if isinstance(table, dict):
            table["zzz"] = 1.0
            # an actuator, a motion or a surrounding of any name may be a mechanism's own
            with pytest.raises(InputError):
                vehicle_from(tree, "vehicle.toml")


def odd(**changes):
    """The names of the checks that find a body odd, with its key."""
    tree = {
        "schema": 1, "name": "body", "kind": "submerged-body", "dof": ["sway", "yaw"],
        "body": {"mass": 50.0, "inertia": [1.0, 9.0, 9.0]}, "coefficients": {"N_r": -1.0, "N_delta_r": -3.0},
        "inputs": {"rudder": "delta_r"}, "outputs": {"r": {}},
    }  # fmt: skip
    for key, value in changes.items():
        tree[key] = tree[key] | value if isinstance(tree.get(key), dict) else value
    found = vehicle_findings(vehicle_from(tree, "body.toml"), "body.toml")
    assert all(finding.remedy and "\n" not in finding.line() for finding in found)
    return [(finding.check, finding.severity, finding.where.partition(": ")[2]) for finding in found]


def test_what_is_odd_about_a_body_is_reported():
    assert odd() == []
    assert odd(body={"inertia": [1.0, 2.0, 9.0]}) == [("inertia-triangle", "warning", "body.inertia")]
    assert odd(body={"weight": 50.0}) == [("weight", "warning", "body.weight")]
    for name in ("Z_w", "Y_p", "N_pdot", "Z_0", "Z_delta_r", "K_vdot", "X_v"):
        assert odd(coefficients={name: -0.01}) == [("locked", "warning", "coefficients")], name
    for name in ("Y_v", "Y_rdot", "N_vdot", "Y_0", "N_v"):
        assert odd(coefficients={name: -0.01}) == [], name
    assert odd(coefficients={"Y_p": -1.0}, prescribed={"p": "p"}) == []
    for actuator in ("thrust", "shaft_speed", "elevator"):
        assert odd(inputs={actuator: "u"}) == [("idle-input", "warning", f"inputs.{actuator}")]
    scaling = [{"effect": "speed-scaling", "equation": "yaw", "with": "elevator"}]
    assert odd(inputs={"elevator": "delta_e"}, effects=scaling) == []
    assert odd(dof=["surge", "yaw"], inputs={"thrust": "tau"}) == []


def test_coupling_on_both_sides_and_idle_drive_of_a_mechanism_are_reported():
    tree = tomllib.loads(RIG)
    tree["coefficients"] |= {"D_x_y": 0.1, "K_x_y": 0.2, "K_y_x": 0.0}
    tree["inputs"]["brake"] = "b"
    found = vehicle_findings(vehicle_from(tree, "rig.toml"), "rig.toml")
    assert [(finding.check, finding.severity) for finding in found] == [("coupling", "note"), ("idle-input", "warning")]
    assert "D_y_x" in found[0].line()
    assert "brake" in found[1].line()


def test_diameter_that_is_not_given_is_that_of_the_mass_in_the_water_of_the_file():
    """Claim: a cylinder of that diameter and length displaces the mass, in sea water where the file does not say."""
    body = {"mass": 60.0, "inertia": [1.0, 12.0, 12.0], "length": 2.0}
    for density, more in ((1025.0, {}), (998.0, {"reference_density": 998.0})):
        tree = tomllib.loads(BODY)
        tree["body"] = {"speed": 1.5} | body | more
        diameter = vehicle_from(tree, "vehicle.toml").layout.diameter
        assert density * math.pi / 4.0 * diameter**2 * 2.0 == pytest.approx(60.0, rel=1e-3)
