"""The force figure: what the model lacks in each equation of motion, over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..discrepancy.records.diagnosis import Conclusions, ForceTrace, Location
from ..effects import FORCE_UNITS
from .drawing import (
    BASELINE,
    GREY,
    IMPROVED,
    LOCATED,
    NARROW,
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
from .text import symbol


def force_unit(equation: str) -> str:
    """N or N m; a mechanism's coordinate may be either, so its force is only `generalised`."""
    return FORCE_UNITS.get(equation, "generalised force")


def is_equation(place: Location) -> bool:
    """Whether the mismatch lies in an equation of motion, and not at an actuator or a sensor."""
    return ":" not in place.where


def telling_trace(diagnosis: Conclusions) -> ForceTrace | None:
    """The run whose missing force stands out most, in the located equations or, without any, in all."""
    located = {place.where for place in diagnosis.where}

    def prominence(trace: ForceTrace) -> float:
        chosen = [name for name in trace.force if name in located] or list(trace.force)
        return sum(_mean_square(trace.force[name], trace.band[name]) for name in chosen)

    return max((trace for trace in diagnosis.forces if trace.force), key=prominence, default=None)


def draw_forces(diagnosis: Conclusions) -> Picture | None:
    """The figure for the most telling run, or None when there is no trace."""
    trace = telling_trace(diagnosis)
    if trace is None:
        return None
    remaining = next((other for other in diagnosis.remaining_forces if other.run == trace.run), None)
    alt = f"Force beyond the model over time in run {trace.run}, for {', '.join(trace.force)}"
    wide, narrow = (_render(trace, remaining, diagnosis.where, page) for page in (WIDE, NARROW))
    return Picture("forces", alt, wide, narrow)


def _mean_square(force: np.ndarray, band: np.ndarray) -> float:
    usable = np.isfinite(force) & (band > 0.0)
    return float(np.mean((force[usable] / band[usable]) ** 2)) if usable.any() else 0.0


def _render(trace: ForceTrace, remaining: ForceTrace | None, places: Sequence[Location], page: PageWidth) -> bytes:
    columns = min(page.columns, len(trace.force))
    rows = -(-len(trace.force) // columns)
    figure = new_figure(page.inches, 1.5 * rows + 0.9)
    located = {place.where for place in places}
    for equation, (axes,) in zip(trace.force, panels(figure, len(trace.force), columns), strict=True):
        _shade(axes, trace, places, equation)
        _force_lines(axes, trace, remaining, equation)
        _title(axes, equation, equation in located)
    figure.suptitle(f"Force beyond the model, run {drawable(trace.run, 32)}", x=0.01, ha="left", fontsize=10.5)
    figure.legend(handles=_legend(remaining is not None, places), loc="outside lower left", ncols=2 * page.columns)
    return png(figure)


def _shade(axes: Axes, trace: ForceTrace, places: Sequence[Location], equation: str) -> None:
    for place in places:
        if is_equation(place) and place.where != equation:
            continue  # while a mismatch at an actuator or a sensor may show in any equation
        for run, start, end in place.times:
            if run == trace.run:
                axes.axvspan(start, end, color=LOCATED, alpha=0.18, linewidth=0)


def _force_lines(axes: Axes, trace: ForceTrace, remaining: ForceTrace | None, equation: str) -> None:
    force, band = trace.force[equation], 2.0 * trace.band[equation]
    lower, upper = thin(trace.times, force - band), thin(trace.times, force + band)
    outline = np.column_stack([np.r_[lower[0], upper[0][::-1]], np.r_[lower[1], upper[1][::-1]]])
    axes.add_collection(PolyCollection([outline], color=BASELINE, alpha=0.22, linewidth=0), autolim=False)
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    axes.plot(*thin(trace.times, force), color=BASELINE)
    shown = [_quantile(force, 1.0), _quantile(band, 0.5)]
    if remaining is not None and equation in remaining.force:
        axes.plot(*thin(remaining.times, remaining.force[equation]), color=IMPROVED, linewidth=0.8)
        shown.append(_quantile(remaining.force[equation], 1.0))
    # The band is widest where a run starts and ends; there it may leave the panel, so that the force stays readable.
    limit = 1.2 * max(shown) or 1.0
    axes.set_ylim(-limit, limit)
    axes.set_xlim(trace.times[0], trace.times[-1])


def _quantile(values: np.ndarray, order: float) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, order)) if finite.size else 0.0


def _title(axes: Axes, equation: str, located: bool) -> None:
    weight, color = ("bold", BASELINE) if located else ("normal", GREY)
    axes.set_title(
        f"{drawable(symbol(equation))}{' — mismatch here' if located else ''}", fontweight=weight, color=color
    )
    axes.set_ylabel(force_unit(equation))
    axes.locator_params(axis="y", nbins=4)
    plain_ticks(axes, x=True, y=True)
    if located:
        for side in ("left", "bottom"):
            axes.spines[side].set(color=BASELINE, linewidth=1.3)


def _legend(improved: bool, places: Sequence[Location]) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=BASELINE, label="beyond the baseline"),
        Patch(color=BASELINE, alpha=0.22, linewidth=0, label="its ±2σ"),
    ]
    if improved:
        handles.append(Line2D([], [], color=IMPROVED, linewidth=0.8, label="beyond the improved model"))
    if any(place.times for place in places):
        handles.append(Patch(color=LOCATED, alpha=0.18, linewidth=0, label="significant"))
    return handles
