"""The command as a process: exit codes, signals, and one line for each way in which it ends early."""

import gc
import logging
import os
import sys
import traceback
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem

from ..errors import InputError, OutputError, nearest, suggestion
from .interruption import INTERRUPTED, Watch, leave
from .options import Options

_LONGEST_NAME, _LONGEST_PATH, _LONGEST_MESSAGE = 255, 4095, 500


class Interrupted(Exception):
    """Ctrl-C or SIGTERM; not an ordinary `KeyboardInterrupt`, for which click prints an empty line."""


class Location(click.ParamType):
    """A path that an operating system can take: no NUL, no name that is too long."""

    name = "path"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """`value` as a path.

        Raises
            click.BadParameter: it holds a NUL or is longer than file systems allow.
        """
        raw = os.fsencode(value)
        if b"\0" in raw:
            self.fail("the path holds a NUL character", param, ctx)
        if len(raw) > _LONGEST_PATH or max(map(len, raw.split(b"/"))) > _LONGEST_NAME:
            limit = f"{_LONGEST_NAME} bytes a name, {_LONGEST_PATH} in all"
            self.fail(f"the path is {len(raw)} bytes long, beyond what file systems allow ({limit})", param, ctx)
        return Path(value)

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Whatever files the shell finds."""
        return [CompletionItem(incomplete, type="file")]


class Name(click.Choice):
    """One of some names; the error for a mistyped one names the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The name.

        Raises
            click.UsageError: it is none of them.
        """
        if value not in self.choices:
            names = [str(name) for name in self.choices]
            hint = suggestion(str(value), names, f"choose one of {', '.join(names)}")
            self.fail(f"{value!r:.60} is not known; {hint}", param, ctx)
        return value


class Commands(click.Group):
    """Commands; the error for a mistyped one names the nearest."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that `args` name.

        Raises
            click.UsageError: there is no such command.
        """
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-"):
            near = nearest(name, self.list_commands(ctx))
            ctx.fail(f"no command {name!r}" + (f"; did you mean {near!r}?" if near else ""))
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command.

        Raises
            Interrupted: by Ctrl-C or SIGTERM.
        """
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise Interrupted from None


def run(app: click.Group) -> None:
    """Run `app` on the process's arguments.

    Exit codes: 0 done, 1 an unexpected error or an output that could not be written, 2 bad input, 3 warnings with
    `--strict`, 130 interrupted by Ctrl-C or SIGTERM, as a batch system sends it.
    """
    # imports and tracing make millions of objects, and looking through them at the default threshold costs seconds
    gc.set_threshold(200_000, 50, 50)
    options = Options()
    # where a home cannot be written Matplotlib keeps its fonts in a temporary folder, and says so twice
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with Watch(lambda: _line(_interruption(options))) as options.watch:
        code, message = _ended(app, options)
        if message:
            options.watch.last_word(lambda: print(_line(message), file=sys.stderr))
        if code:
            leave(code)


def _ended(app: click.Group, options: Options) -> tuple[int, str]:
    """How a run of `app` ended: its exit code and, unless it is 0, what there is to say."""
    try:
        app(standalone_mode=False, prog_name="jaxsub", obj=options)
        sys.stdout.flush()
    except InputError as error:
        return 1 if isinstance(error, OutputError) else 2, str(error)
    except click.UsageError as error:
        command = error.ctx.command_path if error.ctx else "jaxsub"
        return 2, f"{_short(error.format_message())}; see {command} --help"
    except (Interrupted, KeyboardInterrupt, click.Abort):
        return INTERRUPTED, _interruption(options)
    except BrokenPipeError:
        # the reader has what it wants; Python's own flush at the end would complain
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1, ""
    except Exception as error:
        if options.debug:
            traceback.print_exc()
        how = "report it with the files and" if options.debug else "run it again with --debug and report"
        return 1, f"unexpected {type(error).__name__}: {_short(str(error))}; {how} the traceback"
    if options.strict and options.warnings:
        return 3, f"{options.warnings} warnings, and --strict allows none"
    return 0, ""


def _interruption(options: Options) -> str:
    return f"interrupted; {options.kept}"


def _short(message: str) -> str:
    line = " ".join(message.split()).rstrip(".")
    return line if len(line) <= _LONGEST_MESSAGE else f"{line[:_LONGEST_MESSAGE]}…"


def _line(message: str) -> str:
    return f"jaxsub: {message}"
