"""A whole command runs without a home folder, with one that cannot be written and without /proc, and says no more."""

import shutil
import subprocess
import sys

import pytest
from commands import environment
from rigs import write_rig

CHECK = [
    sys.executable,
    "-c",
    "from jaxsub.cli import main; main()",
    "check",
    "vehicle.toml",
    "run.csv",
    "--out",
    "out",
]
WITHOUT_PROC = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /proc && exec "$@"', "sh"]


def said(folder, *before, without=(), **more):
    """What the command prints on standard error; it must end with 0, its table printed and its figures written."""
    write_rig(folder)
    given = {name: value for name, value in environment(**more).items() if name not in without}
    done = subprocess.run([*before, *CHECK], cwd=folder, env=given, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "0 errors, 0 warnings, 0 notes" in done.stdout and list(folder.glob("out/figures/*.png"))
    return done.stderr


def test_without_home(tmp_path):
    assert said(tmp_path, without=("HOME",)) == ""


def test_with_a_home_that_cannot_be_written(tmp_path):
    """Claim: one note, that compiled programs are not kept; Matplotlib is silent."""
    line = said(tmp_path, without=("XDG_CACHE_HOME", "XDG_CONFIG_HOME", "MPLCONFIGDIR"), HOME="/dev/null")
    assert line.count("\n") == 1 and line.startswith("note: compiled programs are not kept: /dev/null")


def test_without_proc(tmp_path):
    if not shutil.which("unshare") or subprocess.run([*WITHOUT_PROC, "true"], capture_output=True).returncode:
        pytest.skip("this user may not mount over /proc")
    assert said(tmp_path, *WITHOUT_PROC) == ""
