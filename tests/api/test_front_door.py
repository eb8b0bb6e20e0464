"""`import jaxsub as js` offers typed names at no cost, and its functions answer as the commands do."""

import ast
import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rigs import write_rig

import jaxsub as js
from jaxsub.cli import main


def command(monkeypatch, *words):
    monkeypatch.setattr("sys.argv", ["jaxsub", *map(str, words)])
    main()


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """`vehicle.toml` and `run.csv` of the oscillator."""
    folder = tmp_path_factory.mktemp("rig")
    write_rig(folder)
    return folder


@pytest.fixture(scope="module")
def rig(files):
    return js.read_vehicle(files / "vehicle.toml"), js.load(files / "run.csv")


@pytest.fixture(scope="module")
def found(rig):
    return js.fit(*rig)


def test_import_loads_nothing_and_offers_all_names():
    """Claim: neither JAX nor NumPy is loaded by `import jaxsub`; its names are listed, and others are refused."""
    script = """
import sys
import jaxsub as js
assert not {"jax", "numpy", "pandas", "matplotlib", "bokeh"} & set(sys.modules)
assert set(js.__all__) <= set(dir(js))
assert js.__version__ and not {"jax", "numpy"} & set(sys.modules)
try:
    js.nothing
except AttributeError as error:
    assert "nothing" in str(error)
else:
    raise AssertionError
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_names_are_those_that_a_checker_of_types_sees():
    """Claim: `__all__`, the table of modules and the imports for type checkers name the same objects."""
    tree = ast.parse(Path(js.__file__).read_text(encoding="utf-8"))
    typed = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {a.name: node.module for node in typed.body if isinstance(node, ast.ImportFrom) for a in node.names}
    assert seen == js._MODULES
    assert {*seen, "__version__"} == set(js.__all__) and sorted(js.__all__) == sorted(set(js.__all__))
    assert all(getattr(js, name) is not None for name in js.__all__)


def test_fit_is_that_of_identify(files, found, tmp_path, monkeypatch, capsys):
    """Claim: one recording, nothing prepared, gives the files of `jaxsub identify`, and `summary` what it prints."""
    command(monkeypatch, "identify", files / "vehicle.toml", files / "run.csv", "--out", tmp_path / "out")
    found.completed.save(tmp_path / "saved")
    for name in ("fitted.toml", "coefficients.csv", "identification.json"):
        assert (tmp_path / "saved" / name).read_bytes() == (tmp_path / "out" / name).read_bytes()
    assert found.summary() == capsys.readouterr().out.rstrip("\n")


def test_fit_shows_itself(found):
    """Claim: printed, in a notebook, as a frame and as a picture it has its numbers, and no array."""
    for shown in (repr(found), found._repr_html_()):
        assert "explains these runs" in shown and f"{found.values['K_x']:.6g}" in shown and "identified" in shown
        assert "Array" not in shown and "[[" not in shown
    frame = found.to_dataframe()
    assert list(frame.index) == list(found.values) and frame.loc["D_x", "value"] == found.values["D_x"]
    assert found.plot()._repr_png_()[:4] == b"\x89PNG"
    assert found.identifiability.rank == js.identifiability(found.vehicle, found.recordings).rank == 3


def test_what_runs_identify_and_faults_of_runs_are_printed_in_sentences(rig, found):
    """Claim: both print lines that a reader understands, and a check takes one recording as well as several."""
    vehicle, run = rig
    assert repr(found.identifiability).startswith("The recordings determine 3 of 3 directions")
    assert repr(js.check(vehicle, run)) == repr(js.check(vehicle, [run])) == "Nothing was found in 1 recordings."
    columns = run.columns | {"x": np.where(np.arange(len(run.times)) == 7, 1e3, run.columns["x"])}
    (line,) = repr(js.check(vehicle, js.Recording("run", run.times, columns, "spiked"))).splitlines()
    assert line.startswith("warning: ") and "column 'x'" in line


def test_saved_results_replace_only_what_jaxsub_wrote(found, tmp_path):
    """Claim: an existing folder is refused, with `overwrite` replaced, and refused where a file of it was changed."""
    found.save(tmp_path / "out")
    with pytest.raises(js.InputError, match="already exists"):
        found.save(tmp_path / "out")
    found.save(tmp_path / "out", overwrite=True)
    (tmp_path / "out" / "fitted.toml").write_text("mine")
    with pytest.raises(js.InputError, match="has changed since"):
        found.save(tmp_path / "out", overwrite=True)
    assert (tmp_path / "out" / "fitted.toml").read_text() == "mine"


def test_a_saved_fit_is_loaded_as_it_was(found, tmp_path):
    """Claim: all that it says, its covariance and what it was fitted to are those before; another folder is refused."""
    found.save(tmp_path / "fit")
    again = js.Fit.load(tmp_path / "fit")
    assert (repr(again), again.summary(), again.values) == (repr(found), found.summary(), found.values)
    np.testing.assert_allclose(again.covariance, found.covariance, rtol=1e-9)
    np.testing.assert_array_equal(again.recordings[0].column("x"), found.recordings[0].column("x"))
    assert again.plot().png == found.plot().png
    with pytest.raises(js.InputError, match=r"give a folder that Simulation\.save wrote"):
        js.Simulation.load(tmp_path / "fit")
    with pytest.raises(js.InputError, match=r"does not exist; give a folder that Fit\.save wrote"):
        js.Fit.load(tmp_path)


def test_bad_arguments_are_one_clear_error(rig):
    """Claim: an unknown method, no free number and an absent column name what is wrong and what to do."""
    vehicle, run = rig
    with pytest.raises(js.InputError, match="choose among newton-eq10"):
        js.fit(vehicle, run, method="newtn")
    with pytest.raises(js.InputError, match="nothing to fit"):
        js.fit(vehicle.holding(vehicle.values()), run)
    with pytest.raises(js.InputError, match="'f'"):
        js.fit(vehicle, js.Recording("bare", run.times, {"x": run.column("x")}, "bare"))


def test_simulation_is_that_of_the_command(files, rig, tmp_path, monkeypatch, capsys):
    """Claim: outputs, errors and initial state of every run are those of `jaxsub simulate` on it."""
    command(monkeypatch, "simulate", files / "vehicle.toml", files / "run.csv", "--out", tmp_path / "a.csv", "--json")
    said = json.loads(capsys.readouterr().out)
    vehicle, run = rig
    shown = js.simulate(vehicle, [run, run.between(0.0, 6.0)])
    told = shown[0].to_json()
    assert told["fit"] == said["fit"] and told["explains"] is said["explains"] is True
    np.testing.assert_allclose(list(told["initial_state"].values()), list(said["initial_state"].values()), rtol=1e-12)
    answer = js.load(tmp_path / "a.csv")
    np.testing.assert_allclose(shown.recordings[0].column("x"), answer.column("x"), rtol=1e-12)
    assert list(shown.to_xarray().children) == list(dict.fromkeys(run.recording.name for run in shown.runs))
    assert len(shown) == 2 and "rms/σ" in repr(shown) and "rms/σ" in shown.summary()
    assert shown.plot(1)._repr_png_()[:4] == b"\x89PNG"
    shown.save(tmp_path / "saved")
    again = js.Simulation.load(tmp_path / "saved")
    assert again.summary() == shown.summary() and again[1].to_json() == shown[1].to_json()
    np.testing.assert_array_equal(again.to_dataframe(), shown.to_dataframe())


def test_every_run_of_a_simulation_has_a_file_of_its_own(rig, tmp_path):
    """Claim: pieces of one run are numbered, and a name that another begins with is not taken for one of these."""
    vehicle, run = rig
    begins = {0.0: "run10", 2.0: "run1", 4.0: "run1"}
    runs = [dataclasses.replace(run.between(t, t + 1.9), name=name) for t, name in begins.items()]
    js.simulate(vehicle, runs).save(tmp_path / "saved")
    assert sorted(path.name for path in (tmp_path / "saved").glob("*.csv")) == ["run1-2.csv", "run1.csv", "run10.csv"]


def test_vehicle_and_recording_show_what_they_are(rig):
    """Claim: a vehicle shows numbers, units, bounds and what is free; a recording its channels, length and gaps."""
    vehicle, run = rig
    assert "oscillator: mechanism with x" in repr(vehicle) and "free (3):" in repr(vehicle)
    assert "x (σ 0.01)" in repr(vehicle) and "f" in repr(vehicle)
    assert "Array" not in repr(vehicle)
    auv = js.vehicle_from(
        {"schema": 1, "name": "auv", "kind": "submerged-body", "dof": ["yaw"], "body": {"mass": 30.0, "speed": 1.5,
         "inertia": [1.0, 2.0, 3.0]}, "coefficients": {"N_r": {"value": -3.0, "bounds": [-9.0, 0.0], "prior_std": 1.0}},
         "outputs": {"r": {}}}, "auv.toml",
    )  # fmt: skip
    assert "N_r = -3 N*m/(rad/s), within -9 to 0, prior -3 ± 1" in repr(auv) and "mass = 30 kg" in repr(auv)
    holed = js.Recording("holed", np.array([0.0, 0.1, 0.2, 0.5]), {"u": np.array([1.0, np.nan, 2.0, 3.0])}, "u.csv")
    assert repr(holed) == (
        "Recording 'holed' from u.csv: 4 samples, 0.5 s, every 0.1 s, 1 longer, up to 0.3 s\ncolumns: u (1 missing)"
    )
    assert len(repr(run)) < 200 and "no gaps" in repr(run)
