"""A diagnosis makes few programs, and none for other recordings of the same vehicle and about the same length.

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
import json, sys
sys.path[:0] = {[str(TESTS.parent), str(TESTS), str(TESTS / "discrepancy")]!r}
import jax
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_disable_most_optimizations", True)
from diagnosis_cases import SMALL, recorded, wrong
from jaxsub.discrepancy import diagnose
from jaxsub.effects.sensors import SensorScale
made, counts = [], []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, seconds, **about: made.append(event) if event.endswith("backend_compile_duration") else None
)
for seed, end in ((5, 75.0), (6, 72.5)):
    vehicle, runs = wrong(), [run.between(0.0, end) for run in recorded(SensorScale("q", 0.05), seed)]
    made.clear()
    found, _ = diagnose(vehicle, runs[:2], runs[2:], vocabulary=SMALL if sys.argv[1] == "small" else None)
    counts.append((found.verdict, len(made)))
print(json.dumps(counts))
"""


@pytest.fixture(scope="module", params=["small", pytest.param("whole", marks=pytest.mark.long)])
def counted(request):
    """Verdict and number of programs of two diagnoses, one after the other, in a process of their own."""
    command = [sys.executable, "-c", PROGRAM, request.param]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_diagnosis_makes_few_programs(counted):
    verdict, programs = counted[0]
    assert verdict == "named"
    assert 0 < programs <= MOST


def test_other_recordings_of_about_the_same_length_make_no_program(counted):
    assert counted[1] == ["named", 0]
