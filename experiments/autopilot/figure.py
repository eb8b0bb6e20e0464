"""The picture: found numbers over published ones, and errors on test runs before and after."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from .flight import MISSING

_BEFORE, _AFTER = "#9a9a9a", "#b5482a"


def draw(lines: Sequence[dict], path: Path) -> None:
    """Write the picture of all flights to `path`."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 5.2), layout="constrained", width_ratios=(1.3, 1.0))
    for place, label in enumerate(MISSING):
        found = [line["numbers"][label] for line in lines if label in line["numbers"]]
        at = place + (np.linspace(-0.2, 0.2, len(found)) if len(found) > 1 else np.zeros(len(found)))
        for y, one in zip(at, found, strict=True):
            published = one["published"]
            error = 1.96 * one["standard_error"] / abs(published)
            left.errorbar(one["value"] / published, y, xerr=error, fmt="o", ms=4, color=_AFTER)
        left.annotate(f"{len(found)}/{len(lines)}", (1.01, place), xycoords=("axes fraction", "data"), fontsize=7)
    left.axvline(1.0, color="black", lw=0.8)
    left.set_yticks(range(len(MISSING)), list(MISSING), fontsize=8)
    left.set_xlim(-0.5, 2.5)
    left.invert_yaxis()
    left.set_xlabel("number found / published, 95 %")
    left.set_title("what the file lacks, and how often it was named", fontsize=9)
    channels = list(lines[0]["held_out"]["baseline"])
    for line in lines:
        for kind, colour in (("baseline", _BEFORE), ("improved", _AFTER)):
            left_over = [line["held_out"][kind][channel] for channel in channels]
            right.plot(left_over, channels, "o-", color=colour, lw=0.8, ms=4, alpha=0.8)
    right.plot([], [], "o-", color=_BEFORE, label="before")
    right.plot([], [], "o-", color=_AFTER, label="after")
    right.axvline(1.0, color="black", lw=0.8)
    right.set_xscale("log")
    right.set_xlabel("rms / σ of open-loop simulations, test runs")
    right.legend(frameon=False)
    right.invert_yaxis()
    for axis in (left, right):
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=120)
    plt.close(figure)
