"""A diagnosis makes few programs, none for other recordings of about the same length, and decides without a test run.

A program takes 10 ms to be traced and read from the cache however little it does, and seconds to be compiled.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from commands import environment

TESTS = Path(__file__).parents[1]
MOST = 56
PROGRAM = f"""
import dataclasses, json, sys
sys.path[:0] = {[str(TESTS.parent), str(TESTS), str(TESTS / "discrepancy")]!r}
import jax
import numpy as np
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_disable_most_optimizations", True)
from diagnosis_cases import SMALL, recorded, wrong
from jaxsub.discrepancy import diagnose
from jaxsub.effects.sensors import SensorScale
made, counts = [], []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, seconds, **about: made.append(event) if event.endswith("backend_compile_duration") else None
)
def told(runs):
    made.clear()
    found, improved = diagnose(wrong(), runs[:2], runs[2:], vocabulary=SMALL if sys.argv[1] == "small" else None)
    counts.append((found.verdict, len(made)))
    decided = [repr(found.decisions), repr(found.physics), repr(found.candidates), repr(found.fit["train"])]
    return [*decided, repr({{k: float(v) for k, v in improved.values().items()}})], found.fit["held_out"]

for seed, end in ((5, 75.0), (6, 72.5)):
    runs = [run.between(0.0, end) for run in recorded(SensorScale("q", 0.05), seed)]
    answer = told(runs)
rng = np.random.default_rng(1)
noise = {{name: rng.standard_normal(len(runs[2].times)) for name in wrong().layout.channels}}
replaced = dataclasses.replace(runs[2], columns={{**runs[2].columns, **noise}})
print(json.dumps([counts[:2], answer, told([*runs[:2], replaced])]))
"""


@pytest.fixture(scope="module", params=["small", pytest.param("whole", marks=pytest.mark.long)])
def counted(request):
    """Of two diagnoses in a process of their own the verdict and number of programs; what the second decided.

    And what it decides with noise in the place of the test run's outputs.
    """
    command = [sys.executable, "-c", PROGRAM, request.param]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_diagnosis_makes_few_programs(counted):
    verdict, programs = counted[0][0]
    assert verdict == "named"
    assert 0 < programs <= MOST


def test_other_recordings_of_about_the_same_length_make_no_program(counted):
    assert counted[0][1] == ["named", 0]


def test_nothing_of_the_test_run_takes_part_in_a_decision(counted):
    """Claim: with noise in the place of the test run's outputs every decision and number is the same, bit by bit."""
    _, (decided, error), (again, another) = counted
    assert "accepted" in decided[0] and decided == again
    assert error != another
