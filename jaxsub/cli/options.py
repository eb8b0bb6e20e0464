"""Options that every command takes."""

import dataclasses
from collections.abc import Callable
from typing import Any

import click

from .interruption import Watch


@dataclasses.dataclass
class Options:
    """What the command line says of output.

    **Fields**

    - `quiet`: no progress and no notes; results, warnings and errors stay.
    - `json`: the result on standard output is JSON and nothing else.
    - `debug`: an unexpected error shows its traceback.
    - `strict`: the command ends with exit code 3 when a warning was given.
    - `warnings`: how many warnings were given so far.
    - `kept`: what of the command's results is on disk so far, as the message of an interruption says it.
    - `watch`: what ends the process when it is interrupted.
    """

    quiet: bool = False
    json: bool = False
    debug: bool = False
    strict: bool = False
    warnings: int = 0
    kept: str = "nothing was written"
    watch: Watch | None = None


def options() -> Options:
    """The options of the command that runs; the defaults outside of one."""
    context = click.get_current_context(silent=True)
    return context.ensure_object(Options) if context else Options()


def _flag(name: str, text: str, **settings: Any) -> Callable[[Callable], Callable]:
    def keep(context: click.Context, parameter: click.Parameter, value: bool) -> None:
        setattr(context.ensure_object(Options), name, value or getattr(context.ensure_object(Options), name))

    return click.option(f"--{name}", is_flag=True, help=text, expose_value=False, callback=keep, **settings)


def common(command: Callable) -> Callable:
    """Give `command` the options `--quiet`, `--json`, `--strict` and `--debug`."""
    flags = (
        _flag("debug", "Show the traceback of an unexpected error.", envvar="JAXSUB_DEBUG"),
        _flag("strict", "Exit with 3 when a warning was given."),
        _flag("json", "Print the result as JSON on standard output."),
        _flag("quiet", "No progress and no notes."),
    )
    for flag in flags:
        command = flag(command)
    return command
