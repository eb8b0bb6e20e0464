"""`jaxsub init` writes a vehicle file that other commands take, and nothing for dimensions that cannot be."""

import json

import numpy as np
import pytest
from commands import ran

from jaxsub.cli.app import KINDS, PUBLISHED
from jaxsub.cli.quantity import DIMENSIONS
from jaxsub.recording import Recording, save
from jaxsub.vehicle import initial, like, read_vehicle

AUV = ("--length", "1.33m", "--diameter", "19.1 cm", "--mass", "30.5")


def test_kinds_and_dimensions_are_those_of_the_vehicles():
    assert set(KINDS) == initial.KINDS.keys()
    assert PUBLISHED == like.PUBLISHED
    assert {name.replace("-", "_"): unit for name, (unit, _) in DIMENSIONS.items()} == initial.SIZES


def test_it_prints_or_writes_one_file(monkeypatch, capsys, tmp_path):
    """Claim: units are converted, the terminal shows the file that is written, and a second call is refused."""
    code, shown = ran(monkeypatch, capsys, "init", "auv", *AUV)
    assert code == 0 and "diameter = 0.191\n" in shown.out
    out = tmp_path / "auv.toml"
    code, said = ran(monkeypatch, capsys, "init", "auv", *AUV, "--out", out)
    assert code == 0 and "22 free numbers; inputs propeller = thrust" in said.out
    assert out.read_text() == shown.out
    assert float(read_vehicle(out).values()["mass"]) == 30.5
    assert ran(monkeypatch, capsys, "init", "auv", *AUV, "--out", out)[0] == 2
    out.write_text("mine")
    code, said = ran(monkeypatch, capsys, "init", "auv", *AUV, "--out", out, "--overwrite")
    assert code == 2 and "has changed since" in said.err and out.read_text() == "mine"


def test_its_file_fits_its_log(monkeypatch, capsys, tmp_path):
    """Claim: `check` takes the file begun with a log and that log, and has no error and no unit to complain of."""
    t = 0.1 * np.arange(100)
    columns = {
        "rudder_cmd": 0.1 * np.sin(t),
        "r": -0.1 * np.sin(t - 1.0),
        "psi": 0.1 * np.cos(t),
        "volts": 12.0 + t,
    }
    save(Recording("run", t, columns, "run"), tmp_path / "run.csv", {"rudder_cmd": "deg", "r": "deg/s"})
    out = tmp_path / "auv.toml"
    code, said = ran(monkeypatch, capsys, "init", "auv", *AUV, "--log", tmp_path / "run.csv", "--out", out, "--json")
    content = json.loads(said.out)
    assert code == 0 and content["inputs"] == {"rudder": "rudder_cmd"} and content["outputs"] == ["r", "psi"]
    assert content["unused"] == ["volts"]
    code, said = ran(monkeypatch, capsys, "check", out, tmp_path / "run.csv", "--json")
    assert code == 0 and json.loads(said.out)["errors"] == 0


def test_a_published_vehicle_is_begun_with_the_columns_of_a_log(monkeypatch, capsys, tmp_path):
    """Claim: --like keeps the publication's numbers and comments, and takes inputs and outputs from the log."""
    t = 0.1 * np.arange(50)
    columns = {
        name: np.sin(t + i) for i, name in enumerate(("t1", "t2", "t3", "t4", "t5", "t6", "t7", "port", "r", "v"))
    }
    save(Recording("run", t, columns, "run"), tmp_path / "run.csv", {"r": "deg/s"})
    out = tmp_path / "rov.toml"
    code, said = ran(
        monkeypatch, capsys, "init", "--like", "bluerov2-heavy", "--log", tmp_path / "run.csv", "--out", out
    )
    assert code == 0 and "not used port" in said.out
    text, vehicle = out.read_text(), read_vehicle(out)
    assert "# Not in the log: t8." in text and "von Benzon" in text and "# 0.0134 m³ of fresh water" in text
    assert vehicle.layout.channels == ("r", "v") and float(vehicle.values()["Y_v|v|"]) == -217.0


def test_a_rig_is_begun_by_a_log_alone(tmp_path, monkeypatch, capsys):
    """Claim: `init rig` writes a file that reads, from columns alone, and says what it lacks without a log."""
    t = 0.05 * np.arange(60)
    save(Recording("run", t, {"u": np.sign(np.sin(t)), "x": np.sin(2.0 * t)}, "run"), tmp_path / "run.csv")
    code, printed = ran(monkeypatch, capsys, "init", "rig", "--log", tmp_path / "run.csv")
    assert code == 0 and 'dof = ["x"]' in printed.out and "B_x_u" in printed.out
    for given, said in (
        (("rig",), "has no log"),
        (("rig", "--log", tmp_path / "run.csv", "--mass", "1"), "no dimension"),
    ):
        code, printed = ran(monkeypatch, capsys, "init", *given)
        assert code == 2 and said in printed.err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--length", "-1"), "'-1' is not above zero"),
        (("--length", "0"), "'0' is not above zero"),
        (("--length", "3kg"), "'3kg' is not in m"),
        (("--length", "3 furlong"), "unknown unit 'furlong'"),
        (("--length", "long"), "'long' is no number"),
        (("--length", "1", "--mass", "2"), "--diameter: is missing for an AUV"),
        (("--like", "otter"), "--like: is given beside auv"),
        (("--like", "seaglyder"), "'seaglyder' is not known; did you mean seaglider?"),
        (("--like", "titanic"), "'titanic' is not known; choose one of bluerov2-heavy"),
    ],
)
def test_dimensions_that_cannot_be_are_bad_input(monkeypatch, capsys, given, said):
    code, printed = ran(monkeypatch, capsys, "init", "auv", *given)
    assert code == 2 and said in printed.err and printed.out == ""
