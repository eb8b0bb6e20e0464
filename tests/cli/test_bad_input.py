"""Bad input ends with exit 2 and one line that says where, what and what to do, and nothing is written."""

import numpy as np
import pytest

from jaxsub.cli import main
from jaxsub.recording import Recording, save
from jaxsub.vehicle import vehicle_text
from jaxsub.vehicle.catalogue import dsrv

HEADER = "t[s],delta_s[rad],w,q,theta,z"
ROWS = ["0,0,0,0,0,0", "1,0.1,0,0,0,0", "2,0,0,0,0,0"]


def good(folder):
    (folder / "vehicle.toml").write_text(vehicle_text(dsrv()), encoding="utf-8")
    (folder / "run.csv").write_text("\n".join([HEADER, *ROWS]), encoding="utf-8")


def stopped(monkeypatch, capsys, *arguments):
    monkeypatch.setattr("sys.argv", ["jaxsub", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code, capsys.readouterr().err


CSV = {
    "repeated time": ([HEADER, ROWS[0], ROWS[1], ROWS[1]], ("row 4",)),
    "NaN time": ([HEADER, ROWS[0], "nan,0,0,0,0,0"], ("row 3",)),
    "gap in an input": ([HEADER, ROWS[0], "1,,0,0,0,0", ROWS[2]], ("row 3", "delta_s")),
    "missing column": (["t,delta_s,w,q,theta", "0,0,0,0,0", "1,0,0,0,0"], ("'z'",)),
    "unknown unit": ([HEADER.replace("[rad]", "[furlongsx]"), *ROWS], ("furlongsx",)),
    "empty file": ([], ()),
    "text in a number column": ([HEADER, ROWS[0], "1,fast,0,0,0,0"], ("row 3", "fast")),
    "one row": ([HEADER, ROWS[0]], ()),
}


@pytest.mark.parametrize("name", CSV)
@pytest.mark.parametrize("command", ["diagnose", "identify"])
def test_bad_recordings(tmp_path, monkeypatch, capsys, name, command):
    good(tmp_path)
    lines, words = CSV[name]
    (tmp_path / "run.csv").write_text("\n".join(lines), encoding="utf-8")
    before = sorted(tmp_path.iterdir())
    code, said = stopped(
        monkeypatch, capsys, command, tmp_path / "vehicle.toml", tmp_path / "run.csv", "--out", tmp_path / "out"
    )
    assert code == 2
    assert said.count("\n") == 1 and "run.csv" in said
    assert all(word in said for word in words), said
    assert sorted(tmp_path.iterdir()) == before


VEHICLE = {
    "unknown key": (("mass =", "mas ="), ("mas", "did you mean mass?")),
    "negative mass": (("mass = ", "mass = -"), ("body.mass",)),
    "broken TOML": (("[body]", "[body"), ("line",)),
    "unknown coefficient": (("Z_w =", "Z_ww2 ="), ("Z_ww2",)),
    "indefinite inertia": (("Z_wdot = {value = -", "Z_wdot = {value = 1e5, #"), ("Z_wdot",)),
}


@pytest.mark.parametrize("name", VEHICLE)
def test_bad_vehicles(tmp_path, monkeypatch, capsys, name):
    good(tmp_path)
    (old, new), words = VEHICLE[name]
    text = (tmp_path / "vehicle.toml").read_text(encoding="utf-8")
    assert old in text
    changed = text.replace(old, new, 1)
    if "#" in new:
        changed = "\n".join(line if "#" not in line else "Z_wdot = { value = 1e5 }" for line in changed.splitlines())
    (tmp_path / "vehicle.toml").write_text(changed, encoding="utf-8")
    code, said = stopped(
        monkeypatch, capsys, "diagnose", tmp_path / "vehicle.toml", tmp_path / "run.csv", "--out", tmp_path / "out"
    )
    assert code == 2
    assert said.count("\n") == 1 and "vehicle.toml" in said
    assert all(word in said for word in words), said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["diagnose", "identify", "simulate", "demo"])
def test_an_out_that_exists_is_refused_and_left_alone(tmp_path, monkeypatch, capsys, command):
    good(tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("keep", encoding="utf-8")
    files = [] if command == "demo" else [tmp_path / "vehicle.toml", tmp_path / "run.csv"]
    code, said = stopped(monkeypatch, capsys, command, *files, "--out", out)
    assert code == 2 and said.count("\n") == 1 and ("--out" if command == "simulate" else "--overwrite") in said
    assert [p.name for p in out.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("arguments", [["diagnose"], ["identify", "v.toml"], ["frobnicate"], ["demo", "--seed", "x"]])
def test_bad_arguments_are_one_line_too(monkeypatch, capsys, arguments):
    code, said = stopped(monkeypatch, capsys, *arguments)
    assert code == 2 and said.count("\n") == 1


def test_missing_files_are_named(tmp_path, monkeypatch, capsys):
    code, said = stopped(monkeypatch, capsys, "diagnose", tmp_path / "no.toml", "x.csv", "--out", tmp_path / "out")
    assert code == 2 and "no.toml" in said and said.count("\n") == 1


def test_simulate_writes_a_recording_that_reads_back(tmp_path, monkeypatch):
    from jaxsub.recording import load

    good(tmp_path)
    t = np.arange(40) * 0.25
    save(Recording("inputs", t, {"delta_s": 0.1 * np.sin(t)}, "test"), tmp_path / "inputs.csv")
    monkeypatch.setattr(
        "sys.argv",
        [
            "jaxsub",
            "simulate",
            str(tmp_path / "vehicle.toml"),
            str(tmp_path / "inputs.csv"),
            "--out",
            str(tmp_path / "a.csv"),
        ],
    )
    main()
    answer = load(tmp_path / "a.csv")
    assert set(answer.columns) == {"delta_s", "w", "q", "theta", "z"}
    assert np.ptp(answer.column("q")) > 1e-3
