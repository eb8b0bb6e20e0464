"""What a command says of itself: its settings, inputs and versions beside its results, and its shell completion."""

import hashlib
import json
import platform
import subprocess
import sys
from importlib import metadata

from commands import environment, ran
from rigs import write_rig


def test_a_folder_of_results_says_what_it_was_made_by(tmp_path, monkeypatch, capsys):
    """Claim: `run.json` has every setting, the inputs' digests and the versions, and --overwrite still knows it."""
    write_rig(tmp_path, samples=300)
    vehicle, run, out = tmp_path / "vehicle.toml", tmp_path / "run.csv", tmp_path / "out"
    code, shown = ran(monkeypatch, capsys, "check", vehicle, run, "--out", out)
    assert code in (0, None), shown.err
    found = json.loads((out / "run.json").read_text())
    assert found["command"] == "check" and found["settings"]["runs"] == [str(run)]
    assert found["settings"]["overwrite"] is False and found["settings"]["out"] == str(out)
    digests = {one["path"]: one["sha256"] for one in found["inputs"]}
    assert digests == {str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in (vehicle, run)}
    assert found["versions"]["jax"] == metadata.version("jax")
    assert found["versions"]["python"] == platform.python_version()
    code, shown = ran(monkeypatch, capsys, "check", vehicle, run, "--out", out, "--overwrite")
    assert code in (0, None), shown.err
    assert json.loads((out / "run.json").read_text())["settings"]["overwrite"] is True


def test_version_names_what_computes_and_where(monkeypatch, capsys):
    """Claim: `--version` prints those of jaxsub and jax, and the device."""
    code, shown = ran(monkeypatch, capsys, "--version")
    said = dict(line.split(" ", 1) for line in shown.out.splitlines())
    assert code in (0, None) and said["jaxsub"] == metadata.version("jaxsub")
    assert said["jax"] == metadata.version("jax") and said["device"] == "cpu"


def completed(words):
    """What bash is offered for the last of `words`: kinds and values."""
    asked = {"COMP_WORDS": words, "COMP_CWORD": str(words.count(" ")), "_JAXSUB_COMPLETE": "bash_complete"}
    command = [sys.executable, "-c", "from jaxsub.cli import main; main()"]
    return subprocess.run(command, env=environment(**asked), capture_output=True, text=True, check=True).stdout.split()


def test_a_shell_completes_commands_options_and_paths(monkeypatch, capsys):
    """Claim: the printed script asks for completions, and commands, options, methods and files are offered."""
    code, shown = ran(monkeypatch, capsys, "completion", "bash")
    assert code in (0, None) and "_JAXSUB_COMPLETE=bash_complete" in shown.out
    assert completed("jaxsub iden") == ["plain,identify"]
    assert completed("jaxsub identify --met") == ["plain,--method"]
    assert completed("jaxsub identify ve") == ["file,ve"]
