"""A fit stays on disk, whatever ends what follows it."""

import json
import os
import signal
import subprocess
import sys

import pytest
from rigs import write_rig
from trees import ROOT

# the public command, in which what follows the fit says so and waits to be ended
COMMAND = f"""
import sys, time
sys.path.insert(0, {str(ROOT)!r})
from jaxsub.api import fits
from jaxsub.cli import main
def waiting(*_):
    print("fitted", flush=True)
    time.sleep(600)
fits.coloured_covariance = waiting
main()
"""


def begun(folder, *options):
    """`jaxsub identify`, its fit done."""
    command = [sys.executable, "-c", COMMAND, "identify", "vehicle.toml", "run.csv", "--out", "out", *options]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=folder, env=os.environ | {"JAX_PLATFORMS": "cpu"}, **pipe)
    assert process.stdout.readline() == "fitted\n"
    return process


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_fit_is_kept_when_what_follows_is_ended(tmp_path, number):
    """Claim: after kill -9 and Ctrl-C the fit's three files and their manifest are at --out and say so."""
    write_rig(tmp_path)
    process = begun(tmp_path)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == (-9 if number == signal.SIGKILL else 130) and "Traceback" not in said
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"fitted.toml", "coefficients.csv", "identification.json", "run.json", ".jaxsub.jsonl"}
    found = json.loads((tmp_path / "out" / "identification.json").read_text(encoding="utf-8"))
    assert found["complete"] is False and found["converged"] is True
    assert abs(found["coefficients"]["K_x"]["value"] - 4.0) < 5.0 * found["coefficients"]["K_x"]["standard_error"]


@pytest.mark.long
def test_a_later_call_replaces_the_fit_that_was_kept(tmp_path):
    """Claim: what is left of a killed call is jaxsub's own: --overwrite takes it, and the scratch folder goes."""
    write_rig(tmp_path)
    for options in ((), ("--overwrite",)):
        process = begun(tmp_path, *options)
        process.kill()
        process.communicate(timeout=60)
    assert (tmp_path / "out" / "fitted.toml").exists() and len(list(tmp_path.glob(".jaxsub-*"))) == 1
