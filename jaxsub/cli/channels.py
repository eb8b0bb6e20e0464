"""`jaxsub channels`: what a vehicle's log, or the file of a recording, holds."""

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError, nearest
from ..recording import contents
from . import terminal


def run(log: Path, words: Sequence[str] = ()) -> None:
    """Print name, unit and number of samples of each channel of `log` whose name holds one of `words`."""
    listed, findings = contents(log)
    kept = [row for row in listed if not words or any(word.lower() in row.name.lower() for word in words)]
    if not kept:
        close = next((found for word in words if (found := nearest(word, [row.name for row in listed]))), None)
        remedy = f"did you mean {close!r}?" if close else "name other words, or none for all channels"
        raise InputError(str(log), f"holds no channel named like {' or '.join(words) or 'anything'}", remedy)
    width = max(len(row.name) for row in kept)

    def show() -> None:
        for row in kept:
            terminal.say(f"{row.name:{width}}  {row.samples:>8}  {row.unit}".rstrip())

    content = {"channels": [row._asdict() for row in kept], "findings": [finding.to_json() for finding in findings]}
    terminal.emit(content, show)
    terminal.warn(findings)
