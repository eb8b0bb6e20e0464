"""The figure of what remains: its spectrum, its autocorrelation, and its correlation with an input."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from ..discrepancy.records.diagnosis import Conclusions, Overlay, Remainder
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
from .spectra import spectrum
from .text import power_of_ten, symbol, unit

_PANELS = 3  # of a channel
_COLORS = {"baseline": BASELINE, "improved": IMPROVED}

# one channel's remainders by model
Models = dict[str, Remainder]


def draw_checks(diagnosis: Conclusions) -> Picture | None:
    """Spectrum and correlations of the simulation errors of test runs, of the channels that `draw_overlay` shows."""
    overlay = telling_overlay(diagnosis)
    names = affected_channels(diagnosis, overlay) if overlay else []
    left = {name: {model: known[name] for model, known in diagnosis.remains.items()} for name in names}
    correlated = lambda models: any(np.any(np.isfinite(one.lagged)) for one in models.values())
    left = {name: models for name, models in left.items() if correlated(models)}
    if overlay is None or not left:
        return None
    alt = f"Spectrum and correlations of what remains of {', '.join(left)} in unseen runs"
    units = {name: known.unit for name, known in diagnosis.quality.items()}
    return Picture("checks", alt, *(_render(overlay, left, units, page) for page in (WIDE, NARROW)))


def _render(overlay: Overlay, left: dict[str, Models], units: dict[str, str], page: PageWidth) -> bytes:
    columns = _PANELS if page.columns > 1 else 1
    rows = _PANELS * len(left) // columns
    figure = new_figure(page.inches, 1.6 * rows + 0.6)
    grid = figure.subplots(rows, columns, squeeze=False)
    for (name, models), (density, itself, other) in zip(left.items(), grid.reshape(-1, _PANELS), strict=True):
        _spectrum(density, drawable(symbol(name)), overlay, name, list(models), drawable(unit(units.get(name, ""))))
        _itself(itself, drawable(symbol(name)), models)
        _input(other, drawable(symbol(name)), models)
    handles = [Line2D([], [], color=_COLORS[model], label=f"{model} model") for model in next(iter(left.values()))]
    figure.legend(handles=handles, loc="outside lower left", ncols=2)
    return png(figure)


def _spectrum(axes: Axes, name: str, overlay: Overlay, channel: str, models: list[str], said: str) -> None:
    """Power spectral densities of the residuals in the run that `draw_overlay` shows."""
    axes.set_title(f"{name}: spectrum", fontweight="bold")
    axes.set(xlabel="frequency (Hz)", ylabel=f"({said or '1'})²/Hz")
    found = {m: spectrum(overlay.times, overlay.measured[channel] - getattr(overlay, m)[channel]) for m in models}
    found = {model: one for model, one in found.items() if np.any(one[1] > 0.0)}
    for model, (frequency, density) in found.items():
        axes.loglog(frequency, np.where(density > 0.0, density, np.nan), color=_COLORS[model], linewidth=1.0)
    if found:
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(math.log10(value)))))
            axis.set_minor_locator(NullLocator())


def _itself(axes: Axes, name: str, models: Models) -> None:
    _framed(axes, 2.0 / np.sqrt(max(1, *(one.samples for one in models.values()))))
    for model, one in models.items():
        axes.plot(one.delays, one.lagged, ".-", color=_COLORS[model], markersize=3)
    axes.set_ylim(min(-0.3, axes.get_ylim()[0]), 1.05)
    axes.set_title(f"{name} with itself", fontweight="bold")
    axes.set(xlabel="lag (s)", ylabel="correlation")


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
    axes.set(xlabel="lag (s)", ylabel="standard errors")


def _framed(axes: Axes, band: float) -> None:
    axes.axhspan(-band, band, color=PALE, alpha=0.7, linewidth=0)
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    plain_ticks(axes, x=True, y=True)
