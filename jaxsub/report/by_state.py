"""The figure of forces by state: what the recordings show of the added effects' force, and what these model.

The recordings' is what the baseline and the force it lacks make of them (`discrepancy.effect_forces`). Without effects
that are forces it is what the model lacks.
"""

import dataclasses
import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ..discrepancy.records.diagnosis import Conclusions, ForceTrace
from ..effects import CHANNEL_UNITS
from .drawing import (
    BASELINE,
    GREY,
    IMPROVED,
    NARROW,
    WIDE,
    PageWidth,
    Picture,
    drawable,
    new_figure,
    plain_ticks,
    png,
)
from .forces import force_unit, is_equation
from .text import symbol, unit

_EQUATIONS, _STATES = 2, 2
_MOST_POINTS = 1500
_BINS = 25


@dataclasses.dataclass(frozen=True)
class ByState:
    """One equation's force at the samples of all training runs.

    **Fields**

    - `equation`, `state`: names. `values`: (N,) of the state, SI.
    - `recorded`: (N,) the force by the recordings, N or N m. `modelled`: (N,) by the effects, None without any.
    """

    equation: str
    state: str
    values: Float[np.ndarray, " n"]
    recorded: Float[np.ndarray, " n"]
    modelled: Float[np.ndarray, " n"] | None

    def binned(self, force: Float[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
        """Medians of the state and of a `force` in bins of equal sample count, along the state."""
        order = np.argsort(self.values, kind="stable")
        parts = [part for part in np.array_split(order, _BINS) if part.size]
        return tuple(np.array([np.median(of[part]) for part in parts]) for of in (self.values, force))  # pyright: ignore[reportReturnType]


def forces_by_state(diagnosis: Conclusions) -> list[ByState]:
    """Of the located equations, or those that accepted effects act on, the force by the states that it grows with."""
    found = []
    traces = diagnosis.remaining_forces if diagnosis.improves else diagnosis.forces
    for place in [place for place in diagnosis.where if is_equation(place)][:_EQUATIONS]:
        own = [trace for trace in traces if place.where in trace.force and trace.states]
        for state in _states(place.grows_with, own):
            found.append(_by_state(place.where, state, own))
    return found


def _states(grows_with: Sequence[str], traces: Sequence[ForceTrace]) -> list[str]:
    """The first states in the variables `grows_with`, such as `v` and `r` of `abs(v)` and `v*r`."""
    known = traces[0].states if traces else {}
    named = [name for variable in grows_with for name in re.findall(r"[^\W\d]\w*", variable) if name in known]
    return list(dict.fromkeys(named))[:_STATES]


def _by_state(equation: str, state: str, traces: Sequence[ForceTrace]) -> ByState:
    joined = lambda parts: np.concatenate(list(parts))
    modelled = any(trace.modelled for trace in traces)
    values = joined(trace.states[state] for trace in traces)
    recorded = joined((trace.recorded if modelled else trace.force)[equation] for trace in traces)
    model = joined(trace.modelled[equation] for trace in traces) if modelled else recorded
    kept = np.flatnonzero(np.isfinite(values) & np.isfinite(recorded))
    kept = kept[:: max(1, -(-kept.size // _MOST_POINTS))]
    return ByState(equation, state, values[kept], recorded[kept], model[kept] if modelled else None)


def draw_by_state(diagnosis: Conclusions) -> Picture | None:
    """The figure, or None where no equation is located or nothing is known of its states."""
    shown = [one for one in forces_by_state(diagnosis) if one.values.size >= _BINS]
    if not shown:
        return None
    units = {quality.channel: quality.unit for quality in diagnosis.channels}
    alt = "Force by state: " + ", ".join(f"{one.equation} over {one.state}" for one in shown)
    return Picture("by-state", alt, *(_render(shown, units, page) for page in (WIDE, NARROW)))


def state_unit(state: str, units: dict[str, str]) -> str:
    """The SI unit of a state by its name, or that of the channel of this name; nothing where neither is known."""
    return unit(CHANNEL_UNITS.get(state) or units.get(state, ""))


def _render(shown: Sequence[ByState], units: dict[str, str], page: PageWidth) -> bytes:
    columns = min(page.columns, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(page.inches, 2.4 * rows + 0.7)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for one, axes in zip(shown, grid[: len(shown)], strict=True):
        _panel(axes, one, state_unit(one.state, units))
    for axes in grid[len(shown) :]:
        axes.remove()
    dots = lambda color, label: Line2D([], [], color=color, marker=".", markersize=7, linestyle="none", label=label)
    modelled = any(one.modelled is not None for one in shown)
    handles = [dots(BASELINE, "by the recordings" if modelled else "beyond the model, by the recordings")]
    handles.append(Line2D([], [], color=BASELINE, label="its median"))
    handles += [dots(IMPROVED, "by the effects added")] if modelled else []
    figure.legend(handles=handles, loc="outside lower left", ncols=2 * page.columns)
    return png(figure)


def _panel(axes: Axes, one: ByState, said: str) -> None:
    axes.axhline(0.0, color=GREY, linewidth=0.7)
    axes.plot(one.values, one.recorded, ".", color=BASELINE, markersize=2.2, alpha=0.35)
    if one.modelled is not None:
        axes.plot(one.values, one.modelled, ".", color=IMPROVED, markersize=2.2, alpha=0.6)
    axes.plot(*one.binned(one.recorded), color=BASELINE, linewidth=1.6)
    axes.set_title(drawable(one.equation), fontweight="bold")
    axes.set_ylabel(f"force, {force_unit(one.equation)}")
    axes.set_xlabel(drawable(f"{symbol(one.state)}, {said}" if said else symbol(one.state)))
    axes.locator_params(nbins=5)
    plain_ticks(axes, x=True, y=True)
