"""`python -m experiments.navigate --out DIR [--quick]`: `jaxsub navigate` on real motions, against their references.

Writes `results.json` and a figure. Each part writes recordings and one sensor file for all of them, and calls the
command on these.
"""

import importlib
from pathlib import Path

from ..parts import main

_PARTS = ("broad", "ansfl")


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    return importlib.import_module(f".{name}", __package__).run(out, quick)


if __name__ == "__main__":
    main("experiments.navigate", __doc__, _PARTS, part)
