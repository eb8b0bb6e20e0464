"""How the command ends: exit codes, one line for each mistake, help, signals, a reader that goes away."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest

from jaxsub.cli import app as commands
from jaxsub.cli import process
from jaxsub.cli.options import common, options

ROOT = Path(__file__).parents[2]
BEGIN = "import sys; from jaxsub.cli import main; sys.argv[0] = 'jaxsub'; main()"


def ended(capsys, monkeypatch, app, *arguments):
    monkeypatch.setattr("sys.argv", ["jaxsub", *arguments])
    code = 0
    try:
        process.run(app)
    except SystemExit as stop:
        code = stop.code
    return code, *capsys.readouterr()


@click.group(cls=process.Commands)
@common
def app():
    """Commands that end in every way."""


@app.command()
@common
def fail():
    raise ZeroDivisionError("a\nb")


@app.command()
@common
def warned():
    options().warnings += 2


@app.command()
@common
def interrupted():
    os.kill(os.getpid(), signal.SIGTERM)


@app.command()
@click.argument("path", type=process.Location())
@common
def read(path):
    click.echo(path)


@pytest.mark.parametrize(
    "arguments, code, words",
    [
        (["fail"], 1, ("ZeroDivisionError", "--debug", "report")),
        (["warned"], 0, ()),
        (["warned", "--strict"], 3, ("2 warnings",)),
        (["--strict", "warned"], 3, ("2 warnings",)),
        (["interrupted"], 130, ("interrupted",)),
        (["warne"], 2, ("no command 'warne'", "did you mean 'warned'?")),
        (["qqq"], 2, ("no command 'qqq'",)),
        (["warned", "--strct"], 2, ("--strct", "--strict", "jaxsub warned --help")),
        (["read", "a\0b"], 2, ("NUL",)),
        (["read", "a" * 300], 2, ("300 bytes",)),
        (["read", "a/" * 3000], 2, ("6000 bytes",)),
        (["read", "a", "b" * 2000], 2, ("unexpected extra argument",)),
    ],
)
def test_each_end_has_its_code_and_one_line(capsys, monkeypatch, arguments, code, words):
    got, out, err = ended(capsys, monkeypatch, app, *arguments)
    assert got == code, err
    assert out == "" and err.count("\n") == bool(words) and len(err) < 700
    assert all(word.lower() in err.lower() for word in words), err


@pytest.mark.parametrize("by_variable", [False, True])
def test_debug_shows_the_traceback(capsys, monkeypatch, by_variable):
    if by_variable:
        monkeypatch.setenv("JAXSUB_DEBUG", "1")
    code, _, err = ended(capsys, monkeypatch, app, "fail", *([] if by_variable else ["--debug"]))
    assert code == 1 and "Traceback" in err and "in fail" in err


def test_alone_it_prints_its_help(capsys, monkeypatch):
    code, out, err = ended(capsys, monkeypatch, commands.app)
    assert (code, err) == (0, "") and "diagnose" in out and out.startswith("Usage: jaxsub")


@pytest.mark.parametrize("name", sorted(commands.app.commands))
def test_every_command_has_the_common_options(name):
    found = {option for parameter in commands.app.commands[name].params for option in parameter.opts}
    assert {"--quiet", "--json", "--debug", "--strict"} <= found


def started(*arguments, **settings):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", BEGIN, *arguments], env=environment, **settings)


def test_help_needs_no_jax():
    code = "import sys, jaxsub.cli; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}).returncode == 0


def test_a_reader_that_goes_away_is_no_error():
    read, write = os.pipe()
    os.close(read)
    running = started("--help", stdout=write, stderr=subprocess.PIPE)
    os.close(write)
    assert running.communicate()[1] == b""
