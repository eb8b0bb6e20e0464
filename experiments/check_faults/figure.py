"""The picture of detection by size beside the false-alarm rate."""

import io
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

_NAMED, _OTHER, _FALSE = "#3b6ea5", "#b5482a", "#9a9a9a"
_COLUMNS = 4


def draw(results: dict[str, Any]) -> bytes:
    """The picture as PNG."""
    found, rate = results["detection"], results["clean"]["rate"]
    rows = -(-len(found) // _COLUMNS)
    figure = plt.figure(figsize=(11.0, 2.1 * rows + 0.7), layout="constrained")
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).flat
    for (name, one), axes in zip(found.items(), grid, strict=False):
        places = range(len(one["sizes"]))
        axes.axhline(rate, color=_FALSE, linewidth=1.0, label="clean runs with any alarm")
        axes.plot(places, one["named"], "o-", color=_NAMED, markersize=4, label="fault named")
        axes.plot(places, one["called_something_else"], "x--", color=_OTHER, markersize=4, label="another fault named")
        axes.set_xticks(places, [f"{size:.3g}" for size in one["sizes"]])
        axes.set_ylim(-0.05, 1.05)
        axes.set_title(name, fontsize=9, fontweight="bold", loc="left")
        axes.set_xlabel(one["unit"] or "factor", fontsize=8)
        axes.tick_params(labelsize=7.5)
    for axes in list(grid):
        axes.set_visible(False)
    figure.supylabel("share of runs", fontsize=9)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8.5, frameon=False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    plt.close(figure)
    return buffer.getvalue()
