"""`sweep --compiled` makes a library anew that is damaged in its cache, and finds what it found before."""

import shutil
import subprocess
import sys

import pytest
from commands import environment
from sweep_cases import farthest, files

from jaxsub.sweeps import open_sweep

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")


def swept(folder, name):
    """The sweep by a process of its own, and the one library in its cache."""
    arguments = [*files(folder)[:-1], str(folder / name), "--starts", "3", "--compiled"]
    command = [sys.executable, "-c", "from jaxsub.cli import main; main()", *arguments]
    done = subprocess.run(command, env=environment(folder / "cache"), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (library,) = (folder / "cache").rglob("jaxsub-*.so")
    return open_sweep(folder / name), library


@pytest.mark.long
def test_a_garbled_library_is_made_anew(tmp_path):
    found, library = swept(tmp_path, "sound")
    sound = library.read_bytes()
    library.write_bytes(bytes(byte ^ 0xA5 if i > 64 and i % 97 == 0 else byte for i, byte in enumerate(sound)))
    again, library = swept(tmp_path, "garbled")
    assert library.read_bytes() == sound
    assert farthest(found, again) == 0.0
