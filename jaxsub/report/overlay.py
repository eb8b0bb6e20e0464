"""The before-and-after figure: a run that the fit did not see, measured and modelled."""

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..discrepancy.records.diagnosis import ChannelQuality, Conclusions, Overlay
from ..recording import Recording
from ..vehicle import AbstractVehicle
from .drawing import (
    BASELINE,
    GREY,
    IMPROVED,
    INK,
    NARROW,
    PALE,
    WIDE,
    PageWidth,
    Picture,
    drawable,
    new_figure,
    panels,
    plain_ticks,
    png,
    thin,
)
from .text import symbol, unit

_MOST_CHANNELS = 4


def affected_channels(diagnosis: Conclusions, overlay: Overlay) -> list[str]:
    """The channels of `overlay` that gained most by an improved model, else those that are worst modelled."""
    fit = diagnosis.fit.get("held_out", {})
    baseline, improved = fit.get("baseline", {}), fit.get("improved", {}) if diagnosis.improves else {}
    gain = {name: baseline.get(name, 0.0) - improved.get(name, 0.0) for name in overlay.measured}
    return sorted(gain, key=lambda name: -gain[name])[:_MOST_CHANNELS]


def telling_overlay(diagnosis: Conclusions) -> Overlay | None:
    """The run in which the baseline misses most."""
    sigma = lambda channel: diagnosis.quality[channel].sigma if channel in diagnosis.quality else 1.0

    def miss(overlay: Overlay) -> float:
        return max(_rms((overlay.measured[c] - overlay.baseline[c]) / sigma(c)) for c in overlay.measured)

    return max((overlay for overlay in diagnosis.overlays if overlay.measured), key=miss, default=None)


def draw_overlay(diagnosis: Conclusions) -> Picture | None:
    """The figure for the most telling unseen run, or None when there is none."""
    overlay = telling_overlay(diagnosis)
    if overlay is None:
        return None
    names = affected_channels(diagnosis, overlay)
    alt = f"Measured and modelled {', '.join(names)} in run {overlay.run}, and what remains over its noise"
    improved = diagnosis.improves
    title = f"Not fitted: run {drawable(overlay.run, 40)}"
    wide, narrow = (_render(overlay, names, diagnosis.quality, improved, page, title) for page in (WIDE, NARROW))
    return Picture("before-after", alt, wide, narrow)


def draw_run(
    vehicle: AbstractVehicle, recording: Recording, shown: Float[np.ndarray, "k c"], sigma: Float[np.ndarray, " c"]
) -> Picture:
    """Measured and modelled outputs of one run with their residuals, for the channels that are modelled worst.

    `shown` are what `vehicle` shows at the samples of `recording`, and `sigma` the noise of its outputs, SI.
    """
    layout = vehicle.layout
    measured = {name: recording.column(column) for name, column in layout.measured.items()}
    modelled = {name: shown[:, index] for index, name in enumerate(layout.channels)}
    overlay = Overlay(recording.name, recording.times, measured, modelled, {})
    size = dict(zip(layout.channels, sigma.tolist(), strict=True))
    miss = {name: _rms((measured[name] - modelled[name]) / size[name]) for name in measured}
    names = sorted(miss, key=lambda name: -miss[name])[:_MOST_CHANNELS]
    units = {name: layout.unit(name) for name in names}
    quality = {name: ChannelQuality(name, units[name], 0, 0.0, size[name], False, 0.0) for name in names}
    title = drawable(f"{layout.name}, run {recording.name}", 80)
    alt = f"Measured and modelled {', '.join(names)} in run {recording.name}, and the residuals over their noise"
    wide, narrow = (_render(overlay, names, quality, False, page, title, "model") for page in (WIDE, NARROW))
    return Picture("run", alt, wide, narrow)


def _render(
    overlay: Overlay,
    names: list[str],
    quality: dict[str, ChannelQuality],
    improved: bool,
    page: PageWidth,
    title: str,
    model: str = "baseline model",
) -> bytes:
    columns = min(page.columns, len(names))
    rows = -(-len(names) // columns)
    figure = new_figure(page.inches, 2.6 * rows + 0.8)
    for name, (above, below) in zip(names, panels(figure, len(names), columns, (2.0, 1.0)), strict=True):
        known = quality.get(name)
        _outputs(above, overlay, name, improved)
        above.set_title(drawable(symbol(name)), fontweight="bold")
        above.set_ylabel(drawable(unit(known.unit)) if known else "SI unit")
        _residuals(below, overlay, name, known.sigma if known else 1.0, improved)
        below.set_ylabel("residual/σ")
    figure.suptitle(title, x=0.01, ha="left", fontsize=10.5)
    figure.legend(handles=_legend(improved, model), loc="outside lower left", ncols=2 * page.columns)
    return png(figure)


def modelled(overlay: Overlay, name: str, improved: bool) -> list[tuple[np.ndarray, str]]:
    """What each model shows of a channel (SI), and its colour."""
    before = [(overlay.baseline[name], BASELINE)]
    return [*before, (overlay.improved[name], IMPROVED)] if improved else before


def _outputs(axes: Axes, overlay: Overlay, name: str, improved: bool) -> None:
    axes.plot(*thin(overlay.times, overlay.measured[name]), ".", color=INK, markersize=2.2, alpha=0.6)
    for values, color in modelled(overlay, name, improved):
        axes.plot(*thin(overlay.times, values), color=color, linewidth=1.3)
    axes.set_xlim(overlay.times[0], overlay.times[-1])
    axes.locator_params(axis="y", nbins=5)
    plain_ticks(axes, x=True, y=True)


def _residuals(axes: Axes, overlay: Overlay, name: str, sigma: float, improved: bool) -> None:
    axes.axhspan(-2.0, 2.0, color=PALE, alpha=0.7, linewidth=0)
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    for values, color in modelled(overlay, name, improved):
        residual = (overlay.measured[name] - values) / sigma
        axes.plot(*thin(overlay.times, residual), ".", color=color, markersize=1.8, alpha=0.7)
    axes.locator_params(axis="y", nbins=3)
    plain_ticks(axes, x=True, y=True)


def _legend(improved: bool, model: str) -> list[Line2D]:
    dots = Line2D([], [], color=INK, marker=".", markersize=7, linestyle="none", label="measured")
    handles = [dots, Line2D([], [], color=BASELINE, label=model)]
    if improved:
        handles.append(Line2D([], [], color=IMPROVED, label="improved model"))
    return [*handles, Line2D([], [], color=PALE, linewidth=6, label="±2σ")]


def _rms(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0
