"""An answer on the way is on disk: a diagnosis that is ended in its second round leaves what the first one accepted."""

import json
import signal
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest
from commands import environment
from rigs import driven, oscillator

from jaxsub.effects import QuadraticDamping
from jaxsub.recording import save
from jaxsub.simulation import synthetic
from jaxsub.vehicle import read_vehicle, write_vehicle

# signals come as soon as the second look at what is left begins
PROGRAM = """
import os, sys
from jaxsub.cli import main
from jaxsub.discrepancy.search import structure_search
from jaxsub.effects import mechanisms, hull_damping
from jaxsub.cli import diagnose
diagnose.vocabulary = lambda: (mechanisms.CoulombFriction, hull_damping.QuadraticDamping)
whole = structure_search.examine
def examine(*given):
    for number in {numbers}:
        os.kill(os.getpid(), number)
    return whole(*given)
structure_search.examine = examine
main()
"""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A rig that lacks a strong square damping, and three runs of the true one."""
    folder = tmp_path_factory.mktemp("files")
    truth = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-3.0)))
    inputs = [driven(truth, 0.1 * np.arange(300), seed, amplitude=1.0) for seed in range(3)]
    for number, run in enumerate(synthetic(truth, inputs, seed=4)):
        save(run, folder / f"run{number}.csv")
    write_vehicle(oscillator(), folder / "vehicle.toml")
    return folder


def ended(files, out, *numbers, begin=()):
    """Exit code and last line on standard error of a diagnosis that is sent these signals in its second round."""
    runs = [str(files / f"run{number}.csv") for number in range(3)]
    program = PROGRAM.format(numbers=[int(number) for number in numbers])
    command = [sys.executable, "-c", program, "diagnose", str(files / "vehicle.toml"), *runs, "--out", str(out), *begin]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600)
    return done.returncode, done.stderr.splitlines()[-1:], json.loads((out / "diagnosis.json").read_text())


@pytest.fixture(scope="module")
def killed(files, tmp_path_factory):
    """What a diagnosis that was killed in its second round has left, and the folder where it lies."""
    out = tmp_path_factory.mktemp("killed") / "out"
    _, _, found = ended(files, out, signal.SIGKILL)
    return found, out


@pytest.mark.long
def test_an_interrupted_diagnosis_ends_with_the_answer_so_far(files, tmp_path):
    """Claim: Ctrl-C gives the effect accepted so far, on the test run, as an incomplete answer with its report."""
    code, said, found = ended(files, tmp_path / "out", signal.SIGINT)
    assert code == 130 and said == [
        f"jaxsub: interrupted; {tmp_path / 'out'} holds the answer so far, which is incomplete"
    ]
    assert found["complete"] is False
    assert [one["effect"] for one in found["physics"]] == ["quadratic-damping"]
    assert found["fit"]["held_out"]["improved"] and (tmp_path / "out" / "report.html").exists()
    assert not list(tmp_path.glob(".jaxsub-*"))


@pytest.mark.long
def test_a_killed_diagnosis_leaves_the_answer_so_far(killed):
    """Claim: kill -9 leaves the effect accepted so far and a vehicle that has it; no test run was looked at."""
    found, out = killed
    assert (found["complete"], found["verdict"], found["fit"]["held_out"]) == (False, "named", {})
    improved = read_vehicle(out / "improved.toml")
    assert [effect.label for effect in improved.effects] == ["quadratic-damping[x]"]


@pytest.mark.long
def test_the_next_call_goes_on_from_the_answer_so_far(files, killed, tmp_path):
    """Claim: begun with the killed one's vehicle it names the effect that is there, and begins with it."""
    begin = ["--begin", str(killed[1] / "improved.toml")]
    code, _, found = ended(files, tmp_path / "again", begin=begin)
    assert code == 0 and found["complete"] and found["verdict"] == "named"
    (own,) = found["physics"]
    assert own["effect"] == "quadratic-damping"
    size = own["parameters"]["D2_x"]
    assert abs(size["value"] + 3.0) < 4.0 * size["standard_error"] < 0.2
    # its first decision is about what it was begun with, and nothing is proposed before
    assert [one["outcome"] for one in found["decisions"][:2]] == ["accepted"] * 2


def test_a_vehicle_without_more_effects_begins_nothing(files, tmp_path):
    """Claim: a vehicle file that adds no effect is refused in one line, and nothing is written."""
    runs = [str(files / f"run{number}.csv") for number in range(3)]
    given = [str(files / "vehicle.toml"), *runs, "--out", str(tmp_path / "out"), "--begin", str(files / "vehicle.toml")]
    program = "from jaxsub.cli import main; main()"
    command = [sys.executable, "-c", program, "diagnose", *given]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600)
    assert done.returncode == 2 and "has no effect that the vehicle lacks" in done.stderr
    assert not (tmp_path / "out").exists()
