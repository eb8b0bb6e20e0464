"""`python -m experiments.identification --out DIR [--quick]`: the first paper on the shared model, its claims measured.

Writes `results.json` and figures like the paper's 3 to 6.
"""

import importlib
from pathlib import Path

from ..parts import main

_PARTS = ("scenario_1", "scenario_2", "identifiability", "sweep", "coverage", "filters", "design")


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    module = {"scenario_1": "scenarios", "scenario_2": "scenarios", "identifiability": "drift"}.get(name, name)
    run = importlib.import_module(f".{module}", __package__).run
    return run(out, int(name[-1])) if module == "scenarios" else run(out, quick)


if __name__ == "__main__":
    main("experiments.identification", __doc__, _PARTS, part)
