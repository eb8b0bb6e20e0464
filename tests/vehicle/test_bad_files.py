"""A vehicle file with a mistake is refused in one line that names the file, the key, what is wrong and the remedy."""

import os
import re

import pytest
from vehicle_texts import BODY, RIG

from jaxsub.errors import InputError
from jaxsub.vehicle import Mechanism, SubmergedBody, read_vehicle

SWAY = 'equation = "sway"\nparameters = { Y_vv = -3.0 }'
DRAG = '"quadratic-damping"\n' + SWAY
SMOOTH = '"smooth-force"\nequation = "sway"\nvariable = "sway"\nlow = -1.0\nhigh = '
BIAS = '"sensor-bias"\nchannel = "r"'
ARM = '"sensor-lever-arm"\nchannel = "r"\naxis = "x"'
TURNED = '"sensor-misalignment"\nchannel = "r"\nsees = "u"'
# what is written instead of what, and how the refusal goes on after the name of the file
MISTAKES = {
    "unknown section": ("[inputs]", "[imputs]", ": imputs: unknown key; did you mean inputs?"),
    "unknown body key": ("mass =", "masss =", ": body.masss: unknown key; did you mean mass?"),
    "unknown coefficient": ("Y_vdot =", "Y_vdott =", ": coefficients.Y_vdott: unknown key; did you mean Y_vdot?"),
    "unknown entry key": ("bounds =", "bouns =", ": coefficients.Y_v.bouns: unknown key; did you mean bounds?"),
    "unknown output key": ("sigma =", "sigm =", ": outputs.r.sigm: unknown key; did you mean sigma?"),
    "schema": ("schema = 1", "schema = 2", ": schema: is 2; this version reads schema = 1"),
    "no schema": ("schema = 1", "", ": schema: is missing; add schema = …"),
    "no name": ('name = "body"', "", ": name: is missing; add name = …"),
    "kind": ("submerged-body", "submerged-bdy", ": kind: 'submerged-bdy' is not known; did you mean submerged-body?"),
    "no mass": ("mass = 50.0", "", ": body.mass: is missing; add mass = … in kg"),
    "negative mass": ("mass = 50.0", "mass = -50.0", ": body.mass: is -50; give a positive number"),
    "text for a number": ("mass = 50.0", 'mass = "50"', ": body.mass: '50' names no other number; write a "),
    "infinite": ("mass = 50.0", "mass = inf", ": body.mass: inf is not a finite number; "),
    "too large": ("mass = 50.0", "mass = 1" + "0" * 400, ": body.mass: 1000"),
    "true for a number": ("mass = 50.0", "mass = true", ": body.mass: True is not a finite number; "),
    "two inertias": ("[1.0, 9.0, 9.0]", "[1.0, 9.0]", ": body.inertia: is not three numbers; "),
    "inertia of zero": ("[1.0, 9.0, 9.0]", "[0.0, 9.0, 9.0]", ": body.I_x: is 0; give a positive number"),
    "broken": ("[body]", "[body", ": is not TOML: .*line 6, column 6"),
    "key twice": ("speed = 1.5", "speed = 1.5\nspeed = 2", ": is not TOML: .*line 10"),
    "table for a word": ('rudder = "delta_r"', "rudder = 3", ": inputs.rudder: 3 is not a column name; "),
    "word for a table": ("[outputs.r]\nsigma = 0.003", "outputs = 3", ": coefficients.outputs|: inputs.outputs"),
    "no outputs": ("[outputs.r]\nsigma = 0.003", "", ": outputs: names no measured channel; "),
    "indefinite": ("Y_vdot = -40.0", "Y_vdot = 1e5", ": coefficients: .* not positive definite because of Y_vdot; "),
    "sigma of zero": ("sigma = 0.003", "sigma = 0", ": outputs.r.sigma: is 0; give a positive number or \"estimate\""),
    "sigma a word": ("sigma = 0.003", 'sigma = "estimated"', ": outputs.r.sigma: 'estimated' is not a finite number"),
    "bounds reversed": ("[-100.0, 0.0]", "[0.0, -100.0]", r": coefficients.Y_v.bounds: is \[0.0, -100.0\]; "),
    "outside bounds": ("[-100.0, 0.0]", "[-50.0, 0.0]", r": coefficients.Y_v: value -60 lies outside its bounds "),
    "no value": ("value = -60.0, ", "", ": coefficients.Y_v: has no value; write { value = … }"),
    "prior": ("bounds = [-100.0, 0.0]", "prior_std = 0", ": coefficients.Y_v.prior_std: is 0; give a positive number"),
    "unknown actuator": ("rudder = ", "ruder = ", ": inputs.ruder: unknown key; did you mean rudder?"),
    "absent actuator": ('rudder = "delta_r"', "", ": coefficients.N_delta_r: acts through rudder; .*inputs"),
    "unknown channel": ("[outputs.r]", "[outputs.rr]", ": outputs.rr: unknown key; did you mean r?"),
    "unknown freedom": ('"sway",', '"swya",', ": dof.swya: unknown key; did you mean sway?"),
    "freedom twice": ('"sway",', '"sway", "sway",', ": dof: names sway twice; "),
    "free and prescribed": ("[inputs]", '[prescribed]\nv = "v"\n[inputs]', ": prescribed.v: sway is free; "),
    "unknown surroundings": ("[inputs]", '[environment]\nrho = "rho"\n[inputs]', ": environment.rho: unknown key"),
    "unknown effect": ("quadratic-damping", "quadratc-damping", r": .*did you mean quadratic-damping?"),
    "effect without option": ('equation = "sway"\n', "", r": effects\[1\].equation: is missing; "),
    "option a number": ('equation = "sway"', "equation = 3", r": effects\[1\].equation: 3 is not a word; "),
    "locked equation": (SWAY, 'equation = "heave"', r": effects\[1\] .*: acts on heave; free that in dof: sway, "),
    "edges in the wrong order": (DRAG, SMOOTH + "-2.0", r": effects\[1\]: .*is not below its high "),
    "spread of nothing": (DRAG, SMOOTH + "2.0\nspread = 0.0", r": effects\[1\].spread: is 0; give a positive number"),
    "unknown equation": (SWAY, 'equation = "swya"', r": effects\[1\] .*: swya: unknown key; did you mean sway?"),
    "unknown parameter": ("Y_vv =", "Y_rr =", r": effects\[1\].parameters.Y_rr: unknown key; known: Y_vv"),
    "effect of no actuator": ('actuator = "rudder"', 'actuator = "ruder"', r": effects.*no actuator ruder; use rudder"),
    "effect of no channel": ('channel = "r"', 'channel = "p"', ": effects.*no channel p; use a channel of"),
    "arm that does not show": (BIAS, ARM, r": effects\[3\]: .*: no arm along x shows in r; one shows in u, "),
    "arm along no axis": (BIAS, ARM.replace('"x"', '"q"'), r": effects\[3\]: .*: no arm along q .*axis x, y or z"),
    "axis of another sensor": (BIAS, TURNED, r": effects\[3\]: .*: r cannot see u; name for a channel another"),
    "axes of one sensor": (BIAS, TURNED.replace('"u"', '"p,q"'), r": effects\[3\]: .*: r cannot see p,q; name for a"),
    "axes of three": (BIAS, TURNED.replace('"u"', '"q,r,p"').replace('"r"', '"p,q,r"'), ": .*p,q,r cannot see q,r,p; "),
    "effect twice": ('"sensor-bias"\nchannel = "r"', '"actuator-lag"\nactuator = "rudder"', r": effects\[3\].*twice; "),
}  # fmt: skip
RIG_MISTAKES = {
    "coefficient of no coordinate": ("K_x =", "K_z =", ": coefficients.K_z: unknown key; did you mean K_"),
    "drive of no actuator": ("B_x_motor", "B_x_mtor", ": coefficients.B_x_mtor: unknown key; did you mean B_x_motor?"),
    "indefinite": ("I_x = 2", "I_x = -2", ": coefficients: .* not positive definite because of I_x; "),
    "channel": ("x_rate", "x_rat", ": outputs.x_rat: unknown key; did you mean x_rate?"),
    "no dof": ('dof = ["x", "y"]', "", ": dof: is missing; "),
    "empty dof": ('["x", "y"]', "[]", ": dof: is not a list of names; "),
    "friction of no coordinate": ('equation = "x"', 'equation = "z"', r": effects\[1\] .*: z: unknown key"),
    "size of zero": ("smoothing = 0.1", "smoothing = 0", r": effects\[1\].smoothing: is 0; give a positive number"),
    "effects a table": ("effects = [{", "effects = {a = {", ": is not TOML: "),
}


def refused(path, text, change):
    old, new, message = change
    assert text.count(old) >= 1
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_vehicle(path)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    assert line.count(";") >= 1
    assert re.match(re.escape(str(path)) + "(" + message.replace("?", r"\?") + ")", line), line


@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistake_in_a_body_is_refused(tmp_path, mistake):
    refused(tmp_path / "body.toml", BODY, MISTAKES[mistake])


@pytest.mark.parametrize("mistake", RIG_MISTAKES)
def test_mistake_in_a_rig_is_refused(tmp_path, mistake):
    refused(tmp_path / "rig.toml", RIG, RIG_MISTAKES[mistake])


def test_files_without_the_mistakes_are_read(tmp_path):
    for name, text, kind in (("body", BODY, SubmergedBody), ("rig", RIG, Mechanism)):
        path = tmp_path / f"{name}.toml"
        path.write_bytes(b"\xef\xbb\xbf" + text.encode())
        assert isinstance(read_vehicle(path), kind)


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_path_that_is_no_file_is_refused_at_once(tmp_path, make):
    make(tmp_path / "vehicle.toml")
    with pytest.raises(InputError, match=r"vehicle\.toml: is (no file|a folder); give the path of a vehicle file"):
        read_vehicle(tmp_path / "vehicle.toml")


def test_path_with_a_nul_is_refused():
    with pytest.raises(InputError, match=r"a\\0b.toml: is no path"):
        read_vehicle("a\0b.toml")


def test_enormous_file_is_refused_unread(tmp_path):
    with (tmp_path / "vehicle.toml").open("wb") as file:
        file.truncate(10**12)  # a sparse file
    with pytest.raises(InputError, match="has 1000000 MB, more than 4; "):
        read_vehicle(tmp_path / "vehicle.toml")


@pytest.mark.parametrize(("content", "message"), [(None, "cannot be read"), (b"\xff\xfe\x00", "is not text")])
def test_file_that_is_not_there_or_no_text_is_refused(tmp_path, content, message):
    path = tmp_path / "vehicle.toml"
    if content:
        path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(f"{path}: {message}")):
        read_vehicle(path)
