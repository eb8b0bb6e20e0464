"""`python -m experiments.controllers --out DIR [--quick]`: does a diagnosed model steer better than the one before it?

`agreement`: how far python-control, CasADi, C and the exported file are from the plant, over states at random, and how
long a step takes in each. One part for each concealed effect: recordings of a truth that conceals it are fitted
(baseline) and diagnosed (improved); a predictive controller of depth and heading is then flown against the truth at
5 Hz on one core with each model and, for the floor, with the truth's own. Same references, sensors and noise.
"""

from pathlib import Path

from experiments.parts import main

from .agreement import agreement
from .flights import CASES, flights


def part(name: str, out: Path, quick: bool) -> dict:
    """The agreement of exports, or one concealed effect."""
    return agreement(out, quick) if name == "agreement" else flights(name, out, quick)


if __name__ == "__main__":
    main("experiments.controllers", __doc__, ("agreement", *CASES), part)
