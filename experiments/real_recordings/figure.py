"""The figure of a set: test runs over time, measured, by the baseline and by the improved model."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from jaxsub.discrepancy import Conclusions
from jaxsub.discrepancy.records.diagnosis import Overlay
from jaxsub.report.drawing import BASELINE, GREY, IMPROVED, INK, new_figure, png, style, thin

from .case import Case

_MOST_RUNS = 3


def draw_held_out(diagnosis: Conclusions, case: Case, path: Path) -> None:
    """Up to three test runs side by side; each channel's traces with the errors below them, in field units."""
    chosen = _spread(diagnosis.overlays)
    channels = list(case.channels)
    with style():
        figure = new_figure(4.6 * len(chosen) + 0.6, 2.5 * len(channels) + 0.7)
        grid = figure.subplots(
            2 * len(channels), len(chosen), sharex="col", squeeze=False, height_ratios=(2.0, 1.0) * len(channels)
        )
        for column, overlay in zip(grid.T, chosen, strict=True):
            column[0].set_title(overlay.run)
            column[-1].set_xlabel("time (s)")
            for i, channel in enumerate(channels):
                _trace(column[2 * i], overlay, channel, *case.channels[channel])
                _errors(column[2 * i + 1], overlay, channel, *case.channels[channel])
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=3)
        figure.suptitle(f"{diagnosis.vehicle}: runs that were not fitted", x=0.01, ha="left", fontsize=10.5)
        path.write_bytes(png(figure))


def _spread(overlays: list[Overlay]) -> list[Overlay]:
    """The first, middle and last of the test runs."""
    picked = np.unique(np.linspace(0, len(overlays) - 1, _MOST_RUNS).round().astype(int))
    return [overlays[i] for i in picked]


def _models(overlay: Overlay) -> list[tuple[str, dict[str, np.ndarray], str]]:
    """The baseline, and the improved model where it is another."""
    models = [("baseline", overlay.baseline, BASELINE), ("improved", overlay.improved, IMPROVED)]
    same = all(np.array_equal(overlay.baseline[c], overlay.improved[c], equal_nan=True) for c in overlay.measured)
    return models[:1] if same else models


def _trace(axes: Axes, overlay: Overlay, channel: str, factor: float, unit: str) -> None:
    measured = thin(overlay.times, factor * overlay.measured[channel])
    axes.plot(*measured, ".", color=INK, markersize=1.8, alpha=0.5, label="measured")
    for label, model, colour in _models(overlay):
        axes.plot(*thin(overlay.times, factor * model[channel]), color=colour, lw=1.0, label=label)
    axes.set_ylabel(f"{channel} ({unit})")


def _errors(axes: Axes, overlay: Overlay, channel: str, factor: float, unit: str) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    for _, model, colour in _models(overlay):
        axes.plot(*thin(overlay.times, factor * (overlay.measured[channel] - model[channel])), color=colour, lw=0.8)
    axes.set_ylabel(f"error ({unit})")
