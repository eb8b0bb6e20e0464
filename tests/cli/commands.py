"""How tests of several commands call them."""

from jaxsub.cli import main


def ran(monkeypatch, capsys, *arguments):
    """The exit code of `jaxsub` with these arguments, and what it printed."""
    monkeypatch.setattr("sys.argv", ["jaxsub", *map(str, arguments)])
    try:
        main()
        code = 0
    except SystemExit as stop:
        code = stop.code
    return code, capsys.readouterr()
