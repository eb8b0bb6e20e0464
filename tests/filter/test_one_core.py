"""Programs with a filter compile on a machine with one visible core.

There XLA's front end drops the calling convention of every LAPACK routine in a program that slices nothing off a
concatenation with nothing (jaxlib 0.10 to 0.12).
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ONE_CORE = """
import os
os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
import jax
jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp
"""
COMPILES = """
from rigs import oscillator, recorded
from jaxsub.discrepancy.explain.process_noise import noise_densities
vehicle = oscillator()
runs = recorded(vehicle, 1, 12, 0.1, seed=1)
noise_densities(vehicle, runs, jnp.zeros((1, 2)), jnp.array([0.01, 0.02]), jnp.ones((1, *runs.outputs.shape)))
"""

pytestmark = pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system pins no process to a core")


def on_one_core(code):
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    return subprocess.run(
        [sys.executable, "-c", ONE_CORE + code], capture_output=True, text=True, env=os.environ | {"PYTHONPATH": path}
    )


def test_noise_filter_compiles_on_one_core():
    done = on_one_core(COMPILES)
    assert done.returncode == 0, done.stderr[-1000:]
