"""A diagnosis on disk gives the same page again, in the place of the old one and of nothing else."""

import dataclasses

import numpy as np
import pytest
from report_examples import VEHICLE, bare, diagnosis

from jaxsub.api.diagnoses import Diagnosis
from jaxsub.cli import main
from jaxsub.cli.output import fresh_folder
from jaxsub.discrepancy.records.decisions import Decision
from jaxsub.discrepancy.records.stored import load_conclusions, save_conclusions
from jaxsub.errors import InputError
from jaxsub.report.page import render
from jaxsub.vehicle.catalogue import dsrv


@pytest.mark.parametrize("verdict", ["none", "named", "ambiguous", "unknown", "bare"])
def test_what_is_read_back_is_what_was_written(verdict, tmp_path):
    """Claim: the page's text is the same to the letter, and arrays to single precision, with numbers not finite too."""
    made = bare() if verdict == "bare" else diagnosis(verdict, samples=60)
    lost = Decision("effect", "a test", float("nan"), 0.01, "rejected")
    made = dataclasses.replace(made, decisions=[lost], p_value=1e-310)
    save_conclusions(made, tmp_path / "diagnosis.npz")
    found = load_conclusions(tmp_path / "diagnosis.npz")
    assert render(found, VEHICLE, {}) == render(made, VEHICLE, {})
    assert found.findings == made.findings and found.where == made.where and found.history == made.history
    for own, theirs in zip(found.remaining_forces, made.remaining_forces, strict=True):
        np.testing.assert_array_equal(own.times, theirs.times)
        np.testing.assert_allclose(own.states["v"], theirs.states["v"], rtol=1e-6)
        np.testing.assert_allclose(own.modelled["yaw"], theirs.modelled["yaw"], rtol=1e-6)


def test_a_saved_diagnosis_is_loaded_as_it_was(written):
    """Claim: verdict, tables, JSON and the improved vehicle are those before, and a next run if there is one."""
    out, _ = written
    made, again = diagnosis("named", samples=40), Diagnosis.load(out)
    assert again.conclusions.to_json() == made.to_json() and again.next_run is None
    assert (repr(again), again.summary()) == (repr(Diagnosis(made, dsrv())), Diagnosis(made, dsrv()).summary())
    assert again.to_dataframe().equals(Diagnosis(made, dsrv()).to_dataframe())
    assert again.improved.own_values().keys() == dsrv().own_values().keys()
    (out / "next_manoeuvre.csv").write_text("t,delta_r\n0,0.1\n1,0.2\n")
    planned = Diagnosis.load(out).next_run
    assert planned is not None and len(planned.times) == 2
    with pytest.raises(InputError, match="give the folder of a diagnosis"):
        Diagnosis.load(out.parent)


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A folder as `diagnose` leaves it, and a function that runs `jaxsub report` on it and returns its exit code."""
    monkeypatch.setattr("jaxsub.report.page.draw", lambda _: {})  # figures have tests of their own
    monkeypatch.setattr("jaxsub.report.page._explorers", lambda _: {})
    with fresh_folder(tmp_path / "out", False) as folder:
        Diagnosis(diagnosis("named", samples=40), dsrv()).write(folder)

    def again(folder=tmp_path / "out"):
        monkeypatch.setattr("sys.argv", ["jaxsub", "report", str(folder)])
        try:
            main()
        except SystemExit as end:
            return end.code or 0
        return 0

    return tmp_path / "out", again


def test_the_command_replaces_the_page_and_nothing_else(written):
    """Claim: the page is as before, run.json and a file of the user's stay, and it can be done again."""
    out, again = written
    page, log = (out / "report.html").read_bytes(), (out / "run.json").read_bytes()
    (out / "notes.txt").write_text("mine")
    (out / "report.html").unlink()
    assert again() == 0 and again() == 0
    assert (out / "report.html").read_bytes() == page and (out / "run.json").read_bytes() == log
    assert (out / "notes.txt").read_text() == "mine"
    assert sorted(path.name for path in out.parent.iterdir()) == ["out"]


def test_a_page_that_somebody_changed_is_left_alone(written, capsys):
    out, again = written
    (out / "report.html").write_text("my own words")
    assert again() == 2
    assert (out / "report.html").read_text() == "my own words"
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "report.html" in line and "has changed since; move it away" in line


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 cut off", None])
def test_what_cannot_be_read_is_said_in_one_line(written, capsys, damage):
    """Claim: an empty, a cut and a missing file end with exit code 2 and one line that names it."""
    out, again = written
    page = (out / "report.html").read_bytes()
    (out / "diagnosis.npz").unlink()
    if damage is not None:
        (out / "diagnosis.npz").write_bytes(damage)
    assert again() == 2 and again(out / "nowhere") == 2
    first, second = capsys.readouterr().err.strip().splitlines()
    assert "diagnosis.npz" in first and "is no folder" in second
    assert (out / "report.html").read_bytes() == page


def test_another_schema_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsub.discrepancy.records.stored._SCHEMA", 2)
    save_conclusions(bare(), tmp_path / "diagnosis.npz")
    monkeypatch.undo()
    with pytest.raises(InputError, match="has schema 2 and not 1"):
        load_conclusions(tmp_path / "diagnosis.npz")
