"""A real command that is ended, or begun twice: the tree is as before, and the second is told who writes."""

import os
import signal
import subprocess
import sys
import time

import pytest
from rigs import write_rig
from trees import ROOT, tree, write


@pytest.fixture
def begun(tmp_path):
    """`jaxsub identify`, begun in a folder and at work, and what was in the folder."""
    write_rig(tmp_path)
    before = tree(tmp_path)
    process = identify(tmp_path)
    while not list(tmp_path.glob(".jaxsub-*")) and process.poll() is None:
        time.sleep(0.02)
    yield tmp_path, process, before
    process.kill()
    process.communicate()


def identify(folder):
    command = [sys.executable, "-c", "from jaxsub.cli import main; main()", "identify", "vehicle.toml", "run.csv"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAX_PLATFORMS": "cpu"}
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([*command, "--out", "out"], cwd=folder, env=environment, **pipe)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_ended_command_leaves_the_tree_as_it_was(begun, number):
    folder, process, before = begun
    process.send_signal(number)
    _, said = process.communicate(timeout=120)
    assert process.returncode != 0 and "Traceback" not in said
    if number == signal.SIGKILL:
        assert list(folder.glob(".jaxsub-*"))
        write("file", folder / "other", "x")
        for name in ("other", ".other.jaxsub.jsonl"):
            (folder / name).unlink()
    assert tree(folder) == before


def test_second_command_is_told_of_the_first(begun):
    folder, process, before = begun
    process.send_signal(signal.SIGSTOP)  # as long as the second takes to start
    second = identify(folder)
    _, said = second.communicate(timeout=120)
    assert second.returncode == 2 and f"out: process {process.pid} on" in said and said.count("\n") == 1
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGCONT)
    process.communicate(timeout=120)
    assert tree(folder) == before
