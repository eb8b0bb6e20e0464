"""`jaxsub init sensors`: a sensor file to start from."""

from contextlib import nullcontext
from pathlib import Path

from ..errors import InputError
from ..navigation.suite.initial import initial_sensors
from ..recording import contents
from . import session, terminal
from .output import fresh_file, paths_of


def run(log: Path | None, given: list[str], out: Path | None, overwrite: bool) -> None:
    """Write a sensor file of the columns that the `log` holds, or print it; options `given` are of vehicle files."""
    if log is None:
        raise InputError("jaxsub init sensors", "has no log", "give the path of a log or a recording after it")
    if given:
        raise InputError(f"--{given[0]}", "is given beside sensors", "leave it out; a sensor file has no vehicle")
    session.start()
    with fresh_file(out, overwrite, paths_of(log)) if out is not None else nullcontext() as path:
        listed, findings = contents(log)
        text = initial_sensors(listed, str(log))
        if path is not None:
            path.write_text(text, encoding="utf-8")
    terminal.warn(findings)
    content = {"schema": 1, "out": out, "file": text}
    terminal.emit(
        content, lambda: terminal.say(text.rstrip() if out is None else f"{out}: a sensor file to begin with")
    )
