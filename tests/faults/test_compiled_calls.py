"""Ctrl-C and SIGTERM end a process that is in a compiled call without end, and what is on disk stays."""

import signal
import subprocess
import sys
import threading
import time

import pytest
from commands import environment
from rigs import write_rig
from trees import tree

from jaxsub.cli.interruption import Watch, interruptible
from jaxsub.cli.output import fresh_folder

ENDLESS = """
import sys, jax
def endless(*_):
    print("begun", flush=True)
    jax.jit(lambda x: jax.lax.while_loop(lambda x: x >= 0.0, lambda x: x + 1.0, x))(0.0).block_until_ready()
"""
WRITER = f"""{ENDLESS}
from pathlib import Path
import click
from jaxsub.cli import interruption, process
from jaxsub.cli.output import fresh_folder
@click.group(cls=process.Commands)
def app():
    pass
@app.command()
@click.argument("grace", type=float)
def write(grace):
    interruption.GRACE = grace
    with fresh_folder(Path("new/out"), True) as folder, fresh_folder(Path("old"), True) as other:
        (folder / "half.txt").write_text("half")
        (other / "half.txt").write_text("half")
        endless()
process.run(app)
"""
IDENTIFY = f"""{ENDLESS}
from jaxsub.api import fits
from jaxsub.cli import main
fits.determined = endless
main()
"""
SWEEP = f"""{ENDLESS}
import itertools
from jaxsub.cli import main
from jaxsub.sweeps import execute
whole = execute.on_this_machine
def first(plan, chunks):
    yield next(iter(whole(plan, chunks[:1])))
    endless()
execute.on_this_machine = first
main()
"""


def begun(folder, program, *arguments):
    """A process that is in its endless call."""
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, "-c", program, *arguments]
    process = subprocess.Popen(command, cwd=folder, env=environment(), **pipe)
    assert process.stdout.readline() == "begun\n", process.communicate()
    return process


def ended(process, *numbers):
    """What the process said until it ended at these signals; one that does not end fails the test."""
    try:
        for number in numbers:
            process.send_signal(number)
        out, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, said
    return out, said


@pytest.mark.parametrize(
    ("grace", "numbers"),
    [("0.5", [signal.SIGINT]), ("0.5", [signal.SIGTERM]), ("1e6", [signal.SIGINT, signal.SIGTERM])],
)
def test_endless_call_is_ended_and_the_old_result_stays(tmp_path, grace, numbers):
    """Claim: after the grace, or at a second signal before it, with one line and no scratch folder."""
    with fresh_folder(tmp_path / "old", False) as folder:
        (folder / "whole.txt").write_text("whole")
    before = tree(tmp_path)
    assert "old/whole.txt" in before
    _, said = ended(begun(tmp_path, WRITER, "write", grace), *numbers)
    assert said == "jaxsub: interrupted; nothing was written\n"
    assert tree(tmp_path) == before


def test_last_word_is_said_once():
    """Claim: where the main thread and the watching one both come to say how the process ends, one of them does."""
    said = []
    with Watch(str) as watch:
        threads = [threading.Thread(target=watch.last_word, args=(lambda: said.append(1),)) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert said == [1]


def test_a_signal_while_a_call_begins_is_answered(monkeypatch):
    """Claim: one that comes before the call's thread is waited for stops the clock as a later one does."""
    start, threads = threading.Thread.start, []

    def interrupted(thread):
        start(thread)
        threads.append(thread)
        if thread.name.startswith("jaxsub"):
            signal.raise_signal(signal.SIGINT)

    with Watch(lambda: "") as watch:
        monkeypatch.setattr(threading.Thread, "start", interrupted)
        monkeypatch.setattr("jaxsub.cli.interruption.GRACE", 0.2)
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda: None, watch)
        # without an answer the process of this test has ended by now
        time.sleep(0.6)
    assert len(threads) == 1


def test_identify_keeps_the_fit(tmp_path):
    """Claim: where what follows the fit is in an endless call, Ctrl-C writes the fit, shows it and ends."""
    write_rig(tmp_path)
    out, said = ended(begun(tmp_path, IDENTIFY, "identify", "vehicle.toml", "run.csv", "--out", "out"), signal.SIGINT)
    assert "K_x" in out and said.splitlines()[-1].startswith("jaxsub: interrupted; out holds the fit")
    assert {"fitted.toml", "coefficients.csv", "identification.json"} <= {path.name for path in tmp_path.glob("out/*")}
    assert not list(tmp_path.glob(".jaxsub-*"))


@pytest.mark.long
def test_sweep_keeps_what_is_done(tmp_path):
    """Claim: where the second chunk is in an endless call, the first stays and is counted."""
    write_rig(tmp_path)
    arguments = ["sweep", "vehicle.toml", "run.csv", "--starts", "300", "--out", "out"]
    _, said = ended(begun(tmp_path, SWEEP, *arguments), signal.SIGINT)
    kept = list(tmp_path.glob("out/cells/*.nc"))
    assert len(kept) == 1
    assert "of 300 searches are kept in out, and the same command goes on" in said.splitlines()[-1]
    assert not list(tmp_path.rglob(".jaxsub-*"))
