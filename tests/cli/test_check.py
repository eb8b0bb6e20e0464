"""`jaxsub check` prints, writes and draws what is wrong with runs, and its exit code says whether one is an error."""

import json

import numpy as np
import pytest
from commands import ran
from rigs import oscillator, write_rig

from jaxsub.cli.runs import load_runs
from jaxsub.errors import InputError
from jaxsub.recording import load, save


@pytest.fixture
def rig(tmp_path):
    write_rig(tmp_path, samples=300)
    return tmp_path


def rewrite(folder, name, change):
    """Write the run with one column changed."""
    run = load(folder / "run.csv")
    (folder / "run.csv").unlink()
    columns = run.columns | {name: change(run.columns[name].copy())}
    save(type(run)(run.name, run.times, columns, run.source), folder / "run.csv")


def with_sentinels(values):
    values[40:60] = -999.0
    return values


def check(rig, monkeypatch, capsys, *more):
    return ran(monkeypatch, capsys, "check", rig / "vehicle.toml", rig / "run.csv", "--out", rig / "out", *more)


def test_a_clean_run_has_no_finding(rig, monkeypatch, capsys):
    code, shown = check(rig, monkeypatch, capsys)
    assert code in (0, None) and "0 errors, 0 warnings" in shown.out
    content = json.loads((rig / "out" / "check.json").read_text())
    assert (content["errors"], content["warnings"], content["findings"]) == (0, 0, [])
    rows = {row["channel"]: row for row in content["channels"]}
    assert set(rows) == {"f", "x", "x_rate"} and rows["x"]["samples"] == 300 and rows["x"]["missing"] == 0


def test_a_warning_is_in_table_file_and_figure_and_does_not_stop(rig, monkeypatch, capsys):
    rewrite(rig, "x", with_sentinels)
    code, shown = check(rig, monkeypatch, capsys)
    assert code in (0, None), shown.err
    assert "sentinel" in shown.out and ", 1 warning, " in shown.out
    content = json.loads((rig / "out" / "check.json").read_text())
    (finding,) = content["findings"]
    assert (finding["check"], finding["channel"], finding["count"]) == ("sentinel", "x", 20)
    # in a file the header is row 1
    assert finding["rows"] == [[42, 61]] and finding["times"][0] == pytest.approx([4.0, 5.9])
    assert next(row for row in content["channels"] if row["channel"] == "x")["missing"] == 20
    pictures = list((rig / "out" / "figures").glob("*.png"))
    assert len(pictures) == 1 and pictures[0].read_bytes().startswith(b"\x89PNG")


def test_an_error_ends_with_2_and_is_written_all_the_same(rig, monkeypatch, capsys):
    rewrite(rig, "x_rate", np.rad2deg)
    code, shown = check(rig, monkeypatch, capsys)
    assert code == 2 and "degrees?" in shown.out and "1 error, " in shown.out
    (finding,) = json.loads((rig / "out" / "check.json").read_text())["findings"]
    assert (finding["check"], finding["severity"]) == ("factor", "error")


def test_a_run_that_cannot_be_read_is_a_finding_beside_others(rig, monkeypatch, capsys):
    (rig / "broken.csv").write_text("t,x,x_rate,f\n0,1,1,1\n0,1,1,1\n1,1,1,1\n0,1,1,1\n")
    rewrite(rig, "x", with_sentinels)
    code, shown = check(rig, monkeypatch, capsys, rig / "broken.csv")
    assert code == 2 and "sentinel" in shown.out and "2 such rows" in " ".join(shown.out.split())
    found = {finding["check"] for finding in json.loads((rig / "out" / "check.json").read_text())["findings"]}
    assert found == {"file", "sentinel"}


def test_without_out_nothing_is_written_and_an_existing_folder_is_kept(rig, monkeypatch, capsys):
    before = sorted(rig.iterdir())
    code, _ = ran(monkeypatch, capsys, "check", rig / "vehicle.toml", rig / "run.csv")
    assert code in (0, None) and sorted(rig.iterdir()) == before
    (rig / "out").mkdir()
    (rig / "out" / "mine.txt").write_text("kept")
    code, shown = check(rig, monkeypatch, capsys)
    assert code == 2 and "out" in shown.err and (rig / "out" / "mine.txt").read_text() == "kept"


def test_load_runs_gives_runs_as_checked_and_prints_what_was_done(rig, capsys):
    rewrite(rig, "x", with_sentinels)
    (run,) = load_runs([rig / "run.csv"], oscillator())
    assert np.isnan(run.columns["x"][40:60]).all() and np.isfinite(run.columns["x"][60:]).all()
    assert "20 rows (7 %) masked as sentinel -999" in " ".join(capsys.readouterr().err.split())


def test_load_runs_stops_at_an_error_and_at_a_file_given_twice(rig):
    with pytest.raises(InputError, match="given twice"):
        load_runs([rig / "run.csv", rig / "run.csv"], oscillator())
    rewrite(rig, "x_rate", np.rad2deg)
    with pytest.raises(InputError, match=r"x_rate is 57"):
        load_runs([rig / "run.csv"], oscillator())
