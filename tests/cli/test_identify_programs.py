"""`jaxsub identify` makes few programs, none for a second recording of the same length, and imports what it needs.

A program takes 10 ms to be traced and read from the cache however little it does, and a large module up to a second.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.recording import save
from jaxsub.simulation import synthetic
from jaxsub.vehicle import write_vehicle

ROOT = Path(__file__).parents[2]
MOST = 25
UNNEEDED = {"diffrax", "h5py", "matplotlib", "optax", "pandas", "scipy.optimize", "scipy.stats", "xarray"}
PROGRAM = """
import json, sys
import jax
from jaxsub.cli import main
made, counts = [], []
jax.monitoring.register_event_duration_secs_listener(
    lambda event, seconds, **about: made.append(event) if event.endswith("backend_compile_duration") else None
)
for run in ("first", "second"):
    made.clear()
    sys.argv = ["jaxsub", "identify", "vehicle.toml", f"{run}.csv", "--out", f"out-{run}"]
    main()
    counts.append(len(made))
print(json.dumps([counts, sorted(sys.modules)]))
"""


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """How many programs two recordings of one vehicle took, one after the other, and which modules are loaded."""
    folder, vehicle = tmp_path_factory.mktemp("identified"), oscillator()
    for seed, name in enumerate(("first", "second")):
        inputs = driven(vehicle, 0.1 * np.arange(120), seed=seed, amplitude=1.0)
        save(synthetic(vehicle, [inputs], seed=seed)[0], folder / f"{name}.csv")
    write_vehicle(vehicle, folder / "vehicle.toml")
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{PROGRAM}"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_identifying_a_vehicle_makes_few_programs(identified):
    assert 0 < identified[0][0] <= MOST


def test_second_recording_of_the_same_length_makes_no_program(identified):
    assert identified[0][1] == 0


def test_modules_that_nothing_needs_are_not_imported(identified):
    assert not UNNEEDED & set(identified[1])
