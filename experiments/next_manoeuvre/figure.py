"""The picture of one case: its inputs, the search, and by how much the truth fits better than its best rival."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from jaxsub.recording import Recording

from .cases import Case

_COLOURS = {"recorded": "#9a9a9a", "telegraph": "#3b6ea5", "design": "#b5482a"}


def draw(
    path: Path, name: str, made: Case, inputs: Mapping[str, Recording], rows: Mapping[str, dict], history: list[float]
) -> None:
    """Write the picture to `path`."""
    held = made.vehicle.layout.held
    figure = plt.figure(figsize=(12.0, 2.2 + 1.5 * max(len(held), 2)), layout="constrained")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.5, 1.0))[0]
    axes = np.atleast_1d(left.subplots(len(held), 1, sharex=True))
    for axis, column in zip(axes, held, strict=True):
        for kind, recording in inputs.items():
            thin = {"lw": 0.8, "alpha": 0.7} if kind == "telegraph" else {"lw": 1.3}
            values = recording.column(column)[:-1]
            axis.step(recording.times[:-1], values, where="post", color=_COLOURS[kind], label=kind, **thin)
        axis.set_ylabel(column)
        axis.grid(alpha=0.25)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    axes[-1].set_xlabel("time, s")
    gaps, search = right.subplots(2, 1, height_ratios=(1.5, 1.0))
    for place, (kind, row) in enumerate(rows.items()):
        gap = np.array(row["gap"])
        gaps.plot(gap, place + np.linspace(-0.15, 0.15, len(gap)), "o", ms=4, color=_COLOURS[kind])
        gaps.plot(row["expected"], place, "|", ms=26, mew=2, color="black", label=None if place else "expected")
        said = f"{row['share_settled']:.0%} settled, {row['share_right']:.0%} right"
        gaps.annotate(said, (0.99, place + 0.28), xycoords=("axes fraction", "data"), ha="right", fontsize=8)
    gaps.axvline(2.0 * np.log(99.0), color="black", lw=0.8, ls=":", label="likelihood ratio 99")
    gaps.set_xscale("symlog", linthresh=10.0)
    gaps.set_yticks(range(len(rows)), list(rows))
    gaps.set_ylim(-0.5, len(rows) - 0.1)
    gaps.margins(x=0.08)
    gaps.set_xlabel("χ² of the best rival less that of the truth")
    against = ", ".join(rival.name for rival in made.rivals[1:])
    gaps.set_title(f"{name}: {made.rivals[0].name}\nagainst {against}", fontsize=9)
    gaps.legend(loc="upper left", fontsize=8, frameon=False, markerscale=0.3)
    search.plot(np.arange(1, len(history) + 1), history, color=_COLOURS["design"])
    search.set_xlabel("evaluation of the search")
    search.set_ylabel("ln separation less penalty", fontsize=8)
    search.grid(alpha=0.25)
    figure.savefig(path, dpi=120)
    plt.close(figure)
