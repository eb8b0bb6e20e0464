"""Every command takes its --out before it reads anything, and tells who else writes there."""

import os

import pytest
from commands import ran
from trees import tree

from jaxsub.cli.output import claimed

COMMANDS = {
    "identify": ["vehicle.toml", "run.csv"],
    "diagnose": ["vehicle.toml", "run.csv"],
    "check": ["vehicle.toml", "run.csv"],
    "simulate": ["vehicle.toml", "run.csv"],
    "sweep": ["vehicle.toml", "run.csv", "--starts", "3"],
    "demo": [],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_second_process_is_told_before_it_reads_anything(tmp_path, monkeypatch, capsys, command):
    """Claim: with neither a vehicle nor a run to read, what is said is who writes there."""
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "new" / "out"
    with claimed(out):
        before = tree(tmp_path)
        code, said = ran(monkeypatch, capsys, command, *COMMANDS[command], "--out", out)
        assert tree(tmp_path) == before
    assert code == 2 and said.out == ""
    assert said.err.count("\n") == 1 and f"{out}: process {os.getpid()} on" in said.err
    assert tree(tmp_path) == {}
