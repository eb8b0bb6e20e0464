"""What a folder holds, file by file, and processes that write results and wait to be ended."""

import hashlib
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
# writes a result of two files, says so, and waits for a line before it ends the block
WRITER = f"""
import sys, signal
from pathlib import Path
sys.path.insert(0, {str(ROOT)!r})
from jaxsub.cli.output import fresh_file, fresh_folder
from jaxsub.errors import InputError
def stop(*_): raise KeyboardInterrupt
signal.signal(signal.SIGTERM, stop)
kind, out, text = sys.argv[1:4]
try:
    with (fresh_folder if kind == "folder" else fresh_file)(Path(out), "--overwrite" in sys.argv) as new:
        if kind == "folder":
            (new / "sub").mkdir()
            (new / "sub" / "b.txt").write_text(text)
            (new / "a.txt").write_text(text)
        else:
            new.write_text(text)
        print("written", flush=True)
        sys.stdin.readline()
except InputError as error:
    print(f"refused: {{error}}", flush=True)
    sys.exit(2)
except KeyboardInterrupt:
    sys.exit(130)
"""


def tree(folder):
    """Each path below `folder` with its kind and content, links not followed."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            found[name] = ("link", str(path.readlink()))
        elif path.is_dir():
            found[name] = ("folder", "")
        else:
            found[name] = ("file", hashlib.sha256(path.read_bytes()).hexdigest())
    return found


def writer(kind, out, text, *options):
    """A process that has written `text` and waits; with what it said."""
    command = [sys.executable, "-c", WRITER, kind, str(out), text, *options]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().strip()


def finished(process):
    """End of a writer that waits: its exit code."""
    process.communicate("\n", timeout=60)
    return process.returncode


def ended(process, number):
    """Exit code of a writer that is sent a signal."""
    process.send_signal(number)
    process.communicate(timeout=60)
    time.sleep(0.01)
    return process.returncode


def write(kind, out, text, *options):
    """A result written whole by a process of its own."""
    process, said = writer(kind, out, text, *options)
    assert said == "written", said
    assert finished(process) == 0
