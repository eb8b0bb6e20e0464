"""A vehicle's log goes through the commands like a recording, and a bad choice of channels is one line."""

import json

import numpy as np
import pytest
from commands import ran

from jaxsub.recording import load

pytest.importorskip("mcap")

VEHICLE = """
schema = 1
name = "rig"
kind = "mechanism"
dof = ["x"]
coefficients = { D_x = 0.5, K_x = 4.0, B_x_drive = 2.0 }
inputs = { drive = "f" }
[outputs.x]
sigma = 0.01
"""
COLUMNS = """
every = 0.05
end = 8.0
[columns]
"x[cm]" = "rig.place"
f = "0.5 * drive.command"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A rig's log: its place at 20 Hz, in cm, and commands that change now and then."""
    from mcap.writer import Writer

    folder = tmp_path_factory.mktemp("rig")
    t = 0.05 * np.arange(200)
    force = np.where(np.sin(1.3 * t) > 0.0, 1.0, -1.0)
    x, v = np.zeros(len(t)), 0.0
    for k in range(len(t) - 1):  # small Euler steps, so that nothing of jaxsub made the log
        at = x[k]
        for _ in range(500):
            at, v = at + 1e-4 * v, v + 1e-4 * (2.0 * force[k] - 0.5 * v - 4.0 * at)
        x[k + 1] = at
    with (folder / "run.mcap").open("wb") as file:
        writer = Writer(file, chunk_size=1000)  # several chunks
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        place, command = (writer.register_channel(topic, "json", schema) for topic in ("rig", "drive"))
        for k, now in enumerate(np.round(1e9 * (1000.0 + t)).astype(int).tolist()):
            writer.add_message(place, now, json.dumps({"place": 100.0 * x[k]}).encode(), now)
            if k == 0 or force[k] != force[k - 1]:
                writer.add_message(command, now, json.dumps({"command": 2.0 * force[k]}).encode(), now)
        writer.finish()
    (folder / "rig.toml").write_text(VEHICLE, encoding="utf-8")
    (folder / "map.toml").write_text(COLUMNS, encoding="utf-8")
    return folder


def test_channels_are_listed(folder, monkeypatch, capsys):
    code, said = ran(monkeypatch, capsys, "channels", folder / "run.mcap")
    assert code == 0
    listed = [line.split() for line in said.out.splitlines()]
    assert [row[0] for row in listed] == ["rig.place", "drive.command"] and listed[0][1] == "200"
    code, said = ran(monkeypatch, capsys, "channels", folder / "run.mcap", "DRIVE")
    assert said.out.startswith("drive.command") and said.out.count("\n") == 1


def test_what_a_cut_log_has_lost_is_a_warning_beside_its_channels(folder, tmp_path, monkeypatch, capsys):
    content = (folder / "run.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: 2 * len(content) // 3])
    code, said = ran(monkeypatch, capsys, "channels", tmp_path / "cut.mcap")
    assert code == 0 and said.err.count("\n") == 1, said.err
    assert said.err.startswith("warning: ") and "cut.mcap: is incomplete: its records break off at byte" in said.err
    assert [line.split()[0] for line in said.out.splitlines()] == ["rig.place", "drive.command"]
    code, said = ran(monkeypatch, capsys, "channels", tmp_path / "cut.mcap", "--json", "--strict")
    assert code != 0 and [f["check"] for f in json.loads(said.out)["findings"]] == ["incomplete-log"]


def test_simulation_follows_the_log(folder, monkeypatch, capsys):
    arguments = (folder / "rig.toml", folder / "run.mcap", "--columns", folder / "map.toml")
    code, said = ran(monkeypatch, capsys, "simulate", *arguments, "--out", folder / "answer.csv")
    assert code == 0, said.err
    answer = load(folder / "answer.csv")
    log = load(folder / "run.mcap", {"x[cm]": "rig.place", "f": "0.5 * drive.command"}, held=["f"])
    np.testing.assert_allclose(answer.times[[0, -1]], [0.0, 8.0], atol=1e-9)
    np.testing.assert_allclose(answer.column("x"), log.column("x")[:161], atol=1e-3)


def test_inputs_are_held_and_outputs_missing_between_samples(folder):
    from jaxsub.cli.runs import load_runs
    from jaxsub.vehicle import read_vehicle

    (folder / "fine.toml").write_text(COLUMNS.replace("0.05", "0.025"), encoding="utf-8")
    (run,) = load_runs([folder / "run.mcap"], read_vehicle(folder / "rig.toml"), folder / "fine.toml")
    assert set(np.abs(run.column("f"))) == {1.0}
    assert np.isnan(run.column("x")).sum() == 160 and len(run.times) == 321


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (COLUMNS.replace("every", "evry"), ("map.toml", "'evry'", "did you mean 'every'")),
        (COLUMNS.replace("rig.place", "rig.plaice"), ("run.mcap", "did you mean 'rig.place'")),
        (COLUMNS.replace("[cm]", "[dge]"), ("x[dge]", "unknown unit")),
        (COLUMNS.replace('"x[cm]" =', "x[cm] ="), ("map.toml", "is not TOML", "quote headers")),
        (COLUMNS.replace("0.05", "-1"), ("every", "-1.0 will not do")),
        ("columns = 3", ("map.toml, columns", "is no table of texts")),
        (COLUMNS.replace("8.0", "'late'"), ("map.toml, end", "'late' is no number")),
        ("", ("map.toml", "names no column")),
        (COLUMNS.replace('f = "0.5 * drive.command"', ""), ("run.mcap", "'f'")),
    ],
)
def test_bad_choice_of_channels_is_one_line(folder, tmp_path, monkeypatch, capsys, text, words):
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    arguments = (folder / "rig.toml", folder / "run.mcap", "--columns", tmp_path / "map.toml")
    code, said = ran(monkeypatch, capsys, "simulate", *arguments, "--out", tmp_path / "answer.csv")
    assert code == 2 and said.err.count("\n") == 1 and all(word in said.err for word in words), said.err
    assert not (tmp_path / "answer.csv").exists()


def test_columns_of_a_csv_are_refused(folder, tmp_path, monkeypatch, capsys):
    (tmp_path / "run.csv").write_text("t,x,f\n0,0,0\n1,0,0\n", encoding="utf-8")
    arguments = (folder / "rig.toml", tmp_path / "run.csv", "--columns", folder / "map.toml")
    code, said = ran(monkeypatch, capsys, "simulate", *arguments, "--out", tmp_path / "answer.csv")
    assert code == 2 and "run.csv" in said.err and "leave --columns out" in said.err
