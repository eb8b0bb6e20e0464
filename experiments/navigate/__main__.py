"""`python -m experiments.navigate --out DIR [--quick]`: `jaxsub navigate` on real motions, against their references.

Writes `results.json` and a figure. Each part writes recordings and one sensor file for all of them, and calls the
command on these.
"""

import importlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..parts import main

_PARTS = ("peers", "broad", "figure", "ansfl")


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    return importlib.import_module(f".{name}", __package__).run(out, quick)


def assembled(found: Mapping[str, dict]) -> dict:
    """BROAD with the peers beside ours and means over the trials, and the other parts by name."""
    others = {name: of for name, of in found.items() if name not in ("peers", "broad", "figure")}
    if "broad" not in found:
        return others
    trials = {
        name: scores | {"rmse_deg": scores["rmse_deg"] | found["peers"]["trials"][name]}
        for name, scores in found["broad"]["trials"].items()
    }
    totals = [{of: errors["total"] for of, errors in scores["rmse_deg"].items()} for scores in trials.values()]
    mean = {of: float(np.mean([total[of] for total in totals])) for of in totals[0]}
    return {"broad": {"trials": trials, "mean_total_deg": mean}, **others}


if __name__ == "__main__":
    main("experiments.navigate", __doc__, _PARTS, part, assembled)
