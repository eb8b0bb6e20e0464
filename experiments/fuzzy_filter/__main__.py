"""`python -m experiments.fuzzy_filter --out DIR [--quick]`: the second paper's filter, claims and uses, measured.

Writes `results.json` and figures, among them such as the paper's 2 to 9. Parts that need real recordings say so and
are left out where there are none.
"""

import importlib
import sys
from collections.abc import Mapping
from pathlib import Path

from ..parts import main

_PARTS = ("regression", "pitch", "broad", "ansfl", "realtime", "throughput", "precision", "submerged")


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    try:
        module = importlib.import_module(f".{name}", __package__)
    except ModuleNotFoundError as error:
        print(f"skipped: no package {error.name}; pip install '.[peers]'", file=sys.stderr)
        raise SystemExit(0) from None
    return module.run(out, quick)


def assembled(found: Mapping[str, dict]) -> dict:
    """The bench's comparison, its claims and its consistency at the top, and beside them the other parts by name."""
    others = {name: of for name, of in found.items() if name != "pitch"}
    return {**found["pitch"], **others, "latency": found["realtime"]["latency"]}


if __name__ == "__main__":
    main("experiments.fuzzy_filter", __doc__, _PARTS, part, assembled)
