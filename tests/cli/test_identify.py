"""`jaxsub identify` says what the recordings identify before what the coefficients are, by every method it offers."""

import csv
import json

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.cli import main
from jaxsub.cli.app import METHODS as OFFERED
from jaxsub.effects.actuators import ActuatorLag
from jaxsub.estimate import METHODS
from jaxsub.parameters import number
from jaxsub.recording import save
from jaxsub.simulate import synthetic
from jaxsub.vehicle import read_vehicle, write_vehicle

TRUTH = {"D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}


@pytest.fixture
def files(tmp_path):
    """A vehicle file whose coefficients are a fifth off, and a recording of the true one."""
    vehicle = oscillator()
    inputs = driven(vehicle, 0.1 * np.arange(120), seed=1, amplitude=1.0)
    save(synthetic(vehicle, [inputs], seed=1)[0], tmp_path / "run.csv")
    away = {name: jnp.asarray(value) for name, value in {"D_x": 0.5, "K_x": 4.6, "B_x_drive": 2.3}.items()}
    write_vehicle(vehicle.with_values(away), tmp_path / "vehicle.toml")
    return tmp_path


def identify(monkeypatch, capsys, folder, *options):
    arguments = [folder / "vehicle.toml", folder / "run.csv", "--out", folder / "out", *options]
    monkeypatch.setattr("sys.argv", ["jaxsub", "identify", *map(str, arguments)])
    main()
    return capsys.readouterr().out


def test_methods_offered_are_those_there_are():
    assert {name.replace("-", "_") for name in OFFERED} == set(METHODS)


@pytest.mark.parametrize("method", ["gauss-newton", "newton", "mekf"])
def test_coefficients_come_with_errors_and_verdicts(files, monkeypatch, capsys, method):
    said = identify(monkeypatch, capsys, files, "--method", method)
    assert said.index("The recordings determine 3 of 3 directions") < said.index("standard error")
    found = json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))
    assert found["method"] == method
    assert {line["kind"] for line in found["identifiability"]["verdicts"]} == {"identified"}
    for name, told in found["coefficients"].items():
        assert abs(told["value"] - TRUTH[name]) < 5.0 * told["standard_error"] + 0.1 * (method == "mekf")
        assert 0.0 < told["standard_error_coloured"] < 3.0 * told["standard_error"]
    with (files / "out" / "coefficients.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == list(found["coefficients"])
    assert {row["verdict"] for row in rows} == {"identified"}
    values = read_vehicle(files / "out" / "fitted.toml").values()
    np.testing.assert_allclose(
        [values[n] for n in TRUTH], [found["coefficients"][n]["value"] for n in TRUTH], rtol=1e-6
    )


def test_coefficients_that_only_a_ratio_of_is_told_are_said_so_with_a_remedy(files, monkeypatch, capsys):
    text = (files / "vehicle.toml").read_text(encoding="utf-8")
    assert "I_x" not in text
    (files / "vehicle.toml").write_text(text.replace("[coefficients]", "[coefficients]\nI_x = 1.0"), encoding="utf-8")
    said = identify(monkeypatch, capsys, files)
    assert "The recordings determine 3 of 4 directions" in said
    assert "only in combination" in said and "T[x,x]" in said
    found = json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))["identifiability"]
    assert found["rank"] == 3
    assert len(found["equivalent_systems"]) == 1
    assert all(line["structural"] and line["remedy"] for line in found["verdicts"])


def test_filter_refuses_an_actuator_with_memory_in_one_line(files, monkeypatch, capsys):
    write_vehicle(oscillator().with_effect(ActuatorLag("drive", number(0.4))), files / "vehicle.toml")
    with pytest.raises(SystemExit) as stop:
        identify(monkeypatch, capsys, files, "--method", "mekf")
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert stop.value.code == 2
    assert "actuator-lag" in said and "output error" in said
    assert not (files / "out").exists()
