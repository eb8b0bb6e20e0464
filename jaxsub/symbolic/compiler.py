"""The C compiler of this machine: `$CC`, a command with its arguments, or `cc`."""

import os
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError


def compiler() -> list[str]:
    """The words of the command that compiles C.

    **Raises** `InputError` where `$CC` is no command line, or names a program that is not there.
    """
    given = os.environ.get("CC", "").strip() or "cc"
    try:
        words = shlex.split(given)
    except ValueError as error:
        raise InputError(f"$CC {given!r}", f"is no command line ({error})", "close its quotation marks") from error
    for word in (words[0], *words[1:2] * _wraps(words[0])):
        if shutil.which(word) is None:
            raise InputError(word, "no C compiler of this name", "install one, or name it in $CC")
    return words


def compile_library(source: str, library: Path, flags: Sequence[str], libraries: Sequence[Sequence[str]]) -> None:
    """Write C `source` beside `library`, and compile it to that; of the `libraries` to link, the first set that works.

    **Raises** `InputError` where there is no C compiler or it fails.
    """
    command, path = compiler(), library.with_suffix(".c")
    path.write_text(source, encoding="utf-8")
    said = ""
    for last in libraries:
        words = [*command, *flags, str(path), "-o", str(library), *last]
        code, said = _run(words)[::2]
        if code == 0:
            return
    raise InputError(shlex.join(command), f"does not compile {path.name}: {said}", "name another compiler in $CC")


def target(flags: Sequence[str]) -> str:
    """What the compiler makes code for with `flags`: its version, the processor's kind and features, as macros.

    Asked of the compiler, it is the same question on every system, and has the answer that `-march=native` has.
    """
    words = [*compiler(), *flags, "-dM", "-E", "-x", "c", os.devnull]
    code, shown, said = _run(words)
    if code:
        raise InputError(shlex.join(words[:-5]), f"does not name its target: {said}", "name another compiler in $CC")
    return "\n".join(sorted(shown.splitlines()))


def _run(words: Sequence[str]) -> tuple[int, str, str]:
    """The exit code of a command, what it wrote, and in a line why it failed."""
    try:
        done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:  # such as a program for another processor
        return 1, "", str(error)
    return done.returncode, done.stdout, _first_error(done.stderr) or f"exit code {done.returncode}"


def _wraps(program: str) -> bool:
    """Whether the word after it is the compiler."""
    return Path(program).name in {"ccache", "sccache", "distcc"}


def _first_error(said: str) -> str:
    """The line of a compiler's messages that says what is wrong, in at most 200 characters."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    return next((line for line in lines if "error" in line.lower()), lines[0] if lines else "")[:200]
