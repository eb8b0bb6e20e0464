"""`jaxsub sweep` goes on where a killed one stopped, takes no other plan's folder, and writes what it says."""

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from commands import environment
from PIL import Image
from sweep_cases import farthest, files, recordings, tree

from jaxsub.cli import main
from jaxsub.recording import save
from jaxsub.sweeps import open_sweep

RUN = [sys.executable, "-c", "from jaxsub.cli import main; main()"]
OPTIONS = ["--starts", "1280", "--spread", "0.8"]


def command(monkeypatch, capsys, *arguments):
    """The command in this process: its exit code and what it said."""
    monkeypatch.setattr("sys.argv", ["jaxsub", *arguments])
    monkeypatch.setattr("jaxsub.cli.session.start", lambda long: None)
    try:
        main()
        code = 0
    except SystemExit as stop:
        code = stop.code
    said = capsys.readouterr()
    return code, said.err + said.out


def kept(folder):
    return {path.name: path.stat().st_mtime_ns for path in (folder / "cells").glob("case*.nc")}


def killed_in_the_middle(arguments, folder, cache):
    """Start the command, kill it once two chunks are kept, and give what it had done."""
    process = subprocess.Popen([*RUN, *arguments, *OPTIONS], env=environment(cache), stderr=subprocess.DEVNULL)
    try:
        while len(kept(folder)) < 2 and process.poll() is None:
            time.sleep(0.01)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    return kept(folder)


@pytest.fixture(scope="module")
def resumed(tmp_path_factory):
    """The folder of a sweep that was killed, what it had then, and its files."""
    folder = tmp_path_factory.mktemp("resumed")
    arguments = files(folder)
    before = killed_in_the_middle(arguments, folder / "out", folder / "cache")
    return folder, arguments, before


def test_a_killed_sweep_does_only_what_is_missing(resumed, monkeypatch, capsys):
    folder, arguments, before = resumed
    assert 2 <= len(before) < 10
    code, said = command(monkeypatch, capsys, *arguments, *OPTIONS)
    assert code == 0, said
    after = kept(folder / "out")
    assert len(after) == 10
    assert before.items() <= after.items()
    code, again = command(monkeypatch, capsys, *arguments, *OPTIONS)
    assert code == 0 and kept(folder / "out") == after
    assert "1280 of 1280" in again
    whole = [*arguments[:-1], str(folder / "whole")]
    assert command(monkeypatch, capsys, *whole, *OPTIONS)[0] == 0
    assert farthest(open_sweep(folder / "whole"), open_sweep(folder / "out")) <= 1e-9
    assert [path.name for path in (folder / "out").rglob(".*")] == [".jaxsub.jsonl"]
    assert not list(folder.glob(".jaxsub-*"))


def test_it_writes_and_says_what_it_found(resumed, monkeypatch, capsys):
    folder, arguments, _ = resumed
    code, said = command(monkeypatch, capsys, *arguments, *OPTIONS)
    told = json.loads((folder / "out" / "sweep.json").read_text(encoding="utf-8"))
    rate = told["cases"][0]["success"]
    assert code == 0 and told["done"] == 1280
    assert f"{rate['successes']} of {rate['count']} searches reach the least cost known" in said
    assert "basins found" in said and "K_x" in said
    cost = open_sweep(folder / "out").cost.values.ravel()
    assert rate["successes"] == np.sum(cost < np.nanmin(cost) + 0.1)
    with Image.open(folder / "out" / "figures" / "sweep-vehicle-all.png") as image:
        assert image.format == "PNG" and len(image.convert("RGB").getcolors(maxcolors=1 << 24)) > 10


@pytest.mark.parametrize(
    ("options", "word"),
    [
        (["--starts", "1281", "--spread", "0.8"], "starts is 1280 there and 1281 here"),
        ([*OPTIONS, "--seed", "2"], "seed"),
    ],
)
def test_another_plan_is_refused_and_the_folder_left_alone(resumed, monkeypatch, capsys, options, word):
    folder, arguments, _ = resumed
    before = {path: path.stat().st_mtime_ns for path in (folder / "out").rglob("*")}
    code, said = command(monkeypatch, capsys, *arguments, *options)
    assert code == 2 and said.count("\n") == 1
    assert word in said and "--overwrite" in said
    assert {path: path.stat().st_mtime_ns for path in (folder / "out").rglob("*")} == before


def test_a_folder_that_is_no_sweep_is_refused_with_and_without_overwrite(tmp_path, monkeypatch, capsys):
    arguments = files(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("keep", encoding="utf-8")
    before = tree(tmp_path)
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "3")
    assert code == 2 and said.count("\n") == 1 and "plan.json" in said
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "3", "--overwrite")
    assert code == 2 and said.count("\n") == 1 and "not written by jaxsub" in said
    assert tree(tmp_path) == before


@pytest.mark.long
def test_overwrite_keeps_the_old_sweep_until_the_new_one_is_done(tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt
        yield

    arguments = files(tmp_path)
    assert command(monkeypatch, capsys, *arguments, "--starts", "3")[0] == 0
    before = tree(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("jaxsub.sweeps.execute.on_this_machine", stopped)
        code, said = command(patch, capsys, *arguments, "--starts", "4", "--overwrite")
    assert code == 130
    assert f"0 of 4 searches are kept in {tmp_path / 'out'}.new" in said
    assert before.items() <= tree(tmp_path).items()
    begun = tree(tmp_path)
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "5", "--overwrite")
    assert code == 2 and said.count("\n") == 1 and "add --overwrite" not in said
    assert f"{tmp_path / 'out'}.new: holds another sweep: starts is 4 there and 5 here" in said
    assert f"move or remove {tmp_path / 'out'}.new" in said and tree(tmp_path) == begun
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "4", "--overwrite")
    assert code == 0 and open_sweep(tmp_path / "out").sizes["start"] == 4
    assert not (tmp_path / "out.new").exists() and not list(tmp_path.glob(".jaxsub-*"))
    (tmp_path / "out" / "sweep.json").write_text("mine", encoding="utf-8")
    for options in ((), ("--overwrite",)):
        code, said = command(monkeypatch, capsys, *arguments, "--starts", "4", *options)
        assert code == 2 and "sweep.json" in said and "changed since" in said
    assert (tmp_path / "out" / "sweep.json").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("damage", [b"", b"{", b'{"plan": 3, "layout": {}}'])
def test_damaged_plan_is_made_anew_by_its_command_and_by_no_other(tmp_path, monkeypatch, capsys, damage):
    arguments = files(tmp_path)
    assert command(monkeypatch, capsys, *arguments, "--starts", "3")[0] == 0
    before, cells = tree(tmp_path), kept(tmp_path / "out")
    (tmp_path / "out" / "plan.json").write_bytes(damage)
    damaged = tree(tmp_path)
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "4")
    assert code == 2 and said.count("\n") == 1 and "give the command that began it" in said
    assert tree(tmp_path) == damaged
    assert command(monkeypatch, capsys, *arguments, "--starts", "3")[0] == 0
    after = tree(tmp_path)
    del before["out/.jaxsub.jsonl"], after["out/.jaxsub.jsonl"]
    assert after == before and kept(tmp_path / "out") == cells


EARLY = {
    "10¹² starts": (["--starts", str(10**12)], "of memory"),
    "2³¹ seeds": (["--starts", "3", "--noise-seeds", str(2**31)], "of memory"),
    "no scheduler": (["--starts", "3", "--cluster", "tcp://127.0.0.1:9"], "no scheduler answers"),
    "no address": (["--starts", "3", "--cluster", "foo://nowhere"], "no scheduler answers"),
    "a word": (["--starts", "3", "--cluster", "there"], "no scheduler answers"),
}


@pytest.mark.parametrize("name", EARLY)
def test_what_cannot_be_is_said_in_one_line_before_anything_is_written(tmp_path, monkeypatch, capsys, name):
    options, word = EARLY[name]
    arguments = files(tmp_path)
    before = tree(tmp_path)
    code, said = command(monkeypatch, capsys, *arguments, *options)
    assert code == 2 and said.count("\n") == 1 and word in said, said
    assert tree(tmp_path) == before


def test_sweep_without_free_coefficients_or_dask_is_refused(tmp_path, monkeypatch, capsys):
    arguments = files(tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "3", "--cluster", "local")
    assert code == 2 and "pip install 'jaxsub[cluster]'" in said
    text = (tmp_path / "vehicle.toml").read_text(encoding="utf-8")
    (tmp_path / "vehicle.toml").write_text(text.replace("}", ", fixed = true}"), encoding="utf-8")
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "3")
    assert code == 2 and "all coefficients are fixed" in said
    assert not (tmp_path / "out").exists()


def test_a_model_that_does_not_explain_its_runs_is_no_success(tmp_path, monkeypatch, capsys):
    arguments = files(tmp_path)
    text = (tmp_path / "vehicle.toml").read_text(encoding="utf-8")
    (tmp_path / "vehicle.toml").write_text(text.replace("sigma = 0.01", "sigma = 0.001"), encoding="utf-8")
    code, said = command(monkeypatch, capsys, *arguments, "--starts", "3", "--strict")
    assert code in (0, 3) and "the best estimate does not explain these runs: x " in said
    told = json.loads((tmp_path / "out" / "sweep.json").read_text(encoding="utf-8"))["cases"][0]
    assert not told["assessment"]["explains"]
    assert sum(basin["count"] for basin in told["basins"]) + told["without_an_end"] == told["basins_of"] == 3


@pytest.mark.long
def test_axes_of_the_command_line(tmp_path, monkeypatch, capsys):
    arguments = files(tmp_path)
    (tmp_path / "other.toml").write_bytes((tmp_path / "vehicle.toml").read_bytes())
    save(recordings(2)[1], tmp_path / "run2.csv")
    more = ["--vehicle", str(tmp_path / "other.toml"), str(tmp_path / "run2.csv"), "--apart", "--noise-seeds", "2"]
    code, said = command(monkeypatch, capsys, *arguments, *more, "--starts", "2")
    assert code == 0, said
    found = open_sweep(tmp_path / "out")
    assert found.vehicle.values.tolist() == ["vehicle", "other"]
    assert found.recording.values.tolist() == ["run", "run2"]
    assert found.noise.values.tolist() == [0, 1]
    told = json.loads((tmp_path / "out" / "sweep.json").read_text(encoding="utf-8"))
    assert all("spread_over_noise" in case["coefficients"]["K_x"] for case in told["cases"])
    assert len(list((tmp_path / "out" / "figures").iterdir())) == 4


def test_an_interrupt_says_what_is_kept(tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr("jaxsub.sweeps.execute.on_this_machine", stopped)
    code, said = command(monkeypatch, capsys, *files(tmp_path), "--starts", "3")
    assert code == 130
    assert f"0 of 3 searches are kept in {tmp_path / 'out'}" in said.splitlines()[-1]
    assert os.path.exists(tmp_path / "out" / "plan.json")


def test_findings_of_the_runs_are_said_once_whatever_the_number_of_vehicles(tmp_path, monkeypatch, capsys):
    arguments = files(tmp_path)
    table = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    spoiled = [*table[:20], re.sub(r"^([^,]*),[^,]*", r"\1,-999", table[20]), *table[21:]]
    (tmp_path / "run.csv").write_text("\n".join(spoiled), encoding="utf-8")
    for name in ("second", "third"):
        (tmp_path / f"{name}.toml").write_bytes((tmp_path / "vehicle.toml").read_bytes())
    others = [word for name in ("second", "third") for word in ("--vehicle", str(tmp_path / f"{name}.toml"))]
    # refused after the runs are checked
    code, said = command(monkeypatch, capsys, *arguments, *others, "--starts", str(10**12))
    warnings = [line for line in said.splitlines() if line.startswith("warning: ")]
    assert code == 2 and warnings and len(set(warnings)) == len(warnings), said
    assert any("run.csv" in line for line in warnings)
