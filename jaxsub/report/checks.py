"""The figure of what remains: whether it is random, and whether it goes with an input."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..discrepancy.diagnosis import Conclusions, Remainder
from .drawing import (
    BASELINE,
    GREY,
    IMPROVED,
    NARROW,
    PALE,
    WIDE,
    PageWidth,
    Picture,
    drawable,
    new_figure,
    plain_ticks,
    png,
)
from .overlay import affected_channels, telling_overlay
from .text import symbol

_COLORS = {"baseline": BASELINE, "improved": IMPROVED}

# one channel's remainders by model
Models = dict[str, Remainder]


def draw_checks(diagnosis: Conclusions) -> Picture | None:
    """Correlations of the simulation errors of test runs, of the channels that `draw_overlay` shows; None without."""
    overlay = telling_overlay(diagnosis)
    names = affected_channels(diagnosis, overlay) if overlay else []
    left = {name: {model: known[name] for model, known in diagnosis.remains.items()} for name in names}
    told = lambda models: any(np.any(np.isfinite(one.lagged)) for one in models.values())
    left = {name: models for name, models in left.items() if told(models)}
    if not left:
        return None
    alt = f"Correlations of what remains of {', '.join(left)} in unseen runs, with itself and with an input"
    return Picture("checks", alt, *(_render(left, page) for page in (WIDE, NARROW)))


def _render(left: dict[str, Models], page: PageWidth) -> bytes:
    rows = 2 * len(left) // page.columns
    figure = new_figure(page.inches, 1.5 * rows + 0.6)
    grid = figure.subplots(rows, page.columns, squeeze=False)
    for (name, models), (itself, other) in zip(left.items(), grid.reshape(-1, 2), strict=True):
        _itself(itself, drawable(symbol(name)), models)
        _input(other, drawable(symbol(name)), models)
    for axes in grid[-1]:
        axes.set_xlabel("s later")
    handles = [Line2D([], [], color=_COLORS[model], label=f"{model} model") for model in next(iter(left.values()))]
    figure.legend(handles=handles, loc="outside lower left", ncols=2)
    return png(figure)


def _itself(axes: Axes, name: str, models: Models) -> None:
    _framed(axes, 2.0 / np.sqrt(max(1, *(one.samples for one in models.values()))))
    for model, one in models.items():
        axes.plot(one.delays, one.lagged, ".-", color=_COLORS[model], markersize=3)
    axes.set_ylim(min(-0.3, axes.get_ylim()[0]), 1.05)
    axes.set_title(f"{name} with itself", fontweight="bold")
    axes.set_ylabel("correlation")


def _input(axes: Axes, name: str, models: Models) -> None:
    """With the input that the last model's remainder goes with most: what is still there is what matters."""
    follows = [one.follows for one in models.values() if one.follows is not None]
    if not follows:
        axes.set_visible(False)
        return
    _framed(axes, 2.0)
    for model, one in models.items():
        if one.inputs:
            either = np.concatenate([-one.delays[::-1], [0.0], one.delays])
            axes.plot(either, one.inputs[follows[-1]], ".-", color=_COLORS[model], markersize=2)
    axes.set_title(f"{name} with {drawable(follows[-1], 24)}", fontweight="bold")
    axes.set_ylabel("standard errors")


def _framed(axes: Axes, band: float) -> None:
    axes.axhspan(-band, band, color=PALE, alpha=0.7, linewidth=0)
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    plain_ticks(axes, x=True, y=True)
