"""Which engine answers: a run of the battery has one, named by its commit."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import jaxsub
from jaxsub.fingerprint import sources

_DIGITS = 12


class Engine(NamedTuple):
    """A state of jaxsub: its `commit`, which says so where files differ from it, and a digest of its `sources`."""

    commit: str
    sources: str


def engine() -> Engine:
    """The engine that this process imports."""
    return Engine(_commit(Path(jaxsub.__file__).parent), sources()[:_DIGITS])


def other(lines: Iterable[dict], today: Engine) -> str | None:
    """The commit of an engine other than today's that answered some of the `lines` of a folder; None if none did."""
    return next((line["engine"]["commit"] for line in lines if line["engine"]["sources"] != today.sources), None)


def require(wanted: Engine) -> None:
    """This process imports the engine `wanted`. **Raises** `RuntimeError` where its sources were changed since."""
    if sources()[:_DIGITS] != wanted.sources:
        raise RuntimeError(f"jaxsub is no longer that of {wanted.commit}: a run has one engine, begin another folder")


def _commit(folder: Path) -> str:
    git = lambda *words: (
        subprocess.run(["git", "-C", folder, *words], capture_output=True, text=True, check=True).stdout
    )
    try:
        changed = git("status", "--porcelain", "--", ".")
        return git("rev-parse", "--short=10", "HEAD").strip() + (" with changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
