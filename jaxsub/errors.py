"""The one error a user can cause, and the hint that goes with a misspelt word."""

import difflib
import importlib
from collections.abc import Iterable
from typing import Any


class InputError(ValueError):
    """Something a user gave is wrong; the command line prints it as one line and exits with 2.

    `where` is the file, row or key, `what` is wrong with it and `remedy` is what to do about it.
    """

    def __init__(self, where: str, what: str, remedy: str):
        # Library messages quoted in `what` may span lines; the contract with the user is one line.
        super().__init__(" ".join(f"{where}: {what}; {remedy}".split()))
        self.parts = (where, what, remedy)

    def within(self, place: str) -> "InputError":
        """The same, of what `place` in a file describes."""
        where, what, remedy = self.parts
        return InputError(f"{place}: {where}", what, remedy)


class OutputError(InputError):
    """A path could not be written, once the work had begun; the command line prints it as one line and exits with 1."""

    def within(self, place: str) -> "OutputError":
        """The same: the path says where."""
        return self


def require_known(kind: str, names: Iterable[str], known: Iterable[str], owner: str) -> None:
    """Every one of `names` is `known` to `owner`. **Raises** `InputError` with a hint for the first that is not."""
    known = tuple(known)
    for name in names:
        if name not in known:
            close = nearest(name, known)
            remedy = f"did you mean {close!r}?" if close else f"there are {', '.join(known)}"
            raise InputError(f"{kind} {name!r}", f"{owner} has none", remedy)


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the entry of `known` spelt most like `word`, or None when nothing is close."""
    by_lower = {entry.lower(): entry for entry in known}
    matches = difflib.get_close_matches(word.lower(), by_lower, n=1)
    return by_lower[matches[0]] if matches else None


def suggestion(word: str, known: Iterable[str], otherwise: str) -> str:
    """What an error says to do about a `word` that is not `known`: the nearest that is, or `otherwise`."""
    close = nearest(word, known)
    return f"did you mean {close}?" if close else otherwise


def optional(module: str, extra: str, purpose: str) -> Any:
    """Import `module`, which the extra `extra` installs. Raises InputError, saying what installs it, where absent."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        what = f"needs the package {(error.name or module).partition('.')[0]}, which is not installed"
        raise InputError(purpose, what, f"pip install 'jaxsub[{extra}]'") from error
