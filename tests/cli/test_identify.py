"""`jaxsub identify` says what the recordings identify before what the coefficients are, by every method it offers."""

import csv
import json
import re

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
from jaxsub.simulation import synthetic
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
    assert said.index("The recordings determine 3 of 3 directions") < said.index("if residuals were white")
    found = json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))
    assert found["method"] == method
    # a filter's estimate is not the likelihood's optimum
    verdict = "not converged" if method == "mekf" else "identified"
    assert {line["kind"] for line in found["identifiability"]["verdicts"]} == {verdict}
    assert (found["converged"], found["assessment"]["explains"]) == (method != "mekf",) * 2
    for name, told in found["coefficients"].items():
        assert abs(told["value"] - TRUTH[name]) < 5.0 * told["standard_error"] + 0.1 * (method == "mekf")
        if method != "mekf":
            assert 0.0 < told["standard_error"] < 3.0 * told["standard_error_white"]
    with (files / "out" / "coefficients.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == list(found["coefficients"])
    assert {row["verdict"] for row in rows} == {verdict}
    values = read_vehicle(files / "out" / "fitted.toml").values()
    np.testing.assert_allclose(
        [values[n] for n in TRUTH], [found["coefficients"][n]["value"] for n in TRUTH], rtol=1e-6
    )


@pytest.mark.long
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


def test_verdict_tables_and_json_come_whole_on_standard_output(files, monkeypatch, capsys):
    """Claim: `--json` prints valid JSON alone, equal to identification.json, with verdict, assessment and warnings."""
    said = identify(monkeypatch, capsys, files, "--json")
    found = json.loads(said)
    assert found == json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))
    assert found["verdict"].startswith("explains these runs: largest rms")
    assert found["complete"] and found["warnings"] == [] and found["assessment"]["explains"]


def test_a_coefficient_at_its_bound_is_called_so_and_has_no_error(files, monkeypatch, capsys):
    """Claim: damping held above its truth is at its lower bound, with a warning and no standard error."""
    text = (files / "vehicle.toml").read_text(encoding="utf-8")
    bounded = re.sub(r"D_x = .*", "D_x = {value = 0.9, bounds = [0.8, 5.0]}", text)
    assert bounded != text
    (files / "vehicle.toml").write_text(bounded, encoding="utf-8")
    arguments = ["jaxsub", "identify", *(str(files / name) for name in ("vehicle.toml", "run.csv"))]
    monkeypatch.setattr("sys.argv", [*arguments, "--out", str(files / "out")])
    main()
    said, warned = capsys.readouterr()
    found = json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))
    damping = found["coefficients"]["D_x"]
    assert (damping["verdict"], damping["standard_error"]) == ("at its lower bound", None)
    assert "is at its lower bound" in warned and "at its lower bound" in said
    assert {warning["check"] for warning in found["warnings"]} >= {"at-bound"}
    assert found["coefficients"]["B_x_drive"]["standard_error"] > 0.0


def test_interruption_after_the_fit_keeps_the_fit(files, monkeypatch, capsys):
    """Claim: Ctrl-C while identifiability is asked leaves all three files, which say that they are not complete."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxsub.api.fits.determined", interrupted)
    with pytest.raises(SystemExit) as stop:
        identify(monkeypatch, capsys, files)
    assert stop.value.code == 130
    assert "holds the fit" in capsys.readouterr().err
    found = json.loads((files / "out" / "identification.json").read_text(encoding="utf-8"))
    assert found["complete"] is False and found["identifiability"] is None
    assert {told["verdict"] for told in found["coefficients"].values()} == {"not asked"}
    assert (files / "out" / "fitted.toml").exists() and (files / "out" / "coefficients.csv").exists()


def test_vehicle_without_free_coefficients_is_one_line(files, monkeypatch, capsys):
    """Claim: exit 2 and one line that names the file."""
    fixed = {name: {"value": 1.0, "fixed": True} for name in TRUTH}
    write_vehicle(oscillator(coefficients=fixed), files / "vehicle.toml")
    with pytest.raises(SystemExit) as stop:
        identify(monkeypatch, capsys, files)
    assert stop.value.code == 2
    assert "all coefficients are fixed" in capsys.readouterr().err


def test_long_runs_are_announced_with_memory_and_time_left(files, monkeypatch, capsys):
    """Claim: where runs are long, memory and time are said before the fit, passes and time left during it."""
    monkeypatch.setattr("jaxsub.cli.effort._LONG", 100)
    monkeypatch.setattr("jaxsub.likelihood.blocks._SHORT", 100)
    monkeypatch.setattr("jaxsub.likelihood.blocks._AT_ONCE", 20)
    for pause in ("_SILENT", "_PIPE"):
        monkeypatch.setattr(f"jaxsub.cli.effort.{pause}", 0.0)
    arguments = ["jaxsub", "identify", *(str(files / name) for name in ("vehicle.toml", "run.csv"))]
    monkeypatch.setattr("sys.argv", [*arguments, "--out", str(files / "out")])
    main()
    said = capsys.readouterr().err
    assert re.search(r"120 samples of 2 channels: takes about [\d.]+ GB and \d+ s", said)
    for stage in ("fitting by gauss-newton", "computing standard errors and identifiability"):
        assert re.search(rf"{stage}: [\d.]+ of about \d+ passes over the samples, \d+ s left", said)
