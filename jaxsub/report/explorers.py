"""Figures that zoom, show values under the pointer, and switch between runs, channels and equations.

They are drawn by Bokeh, whose script travels with the page. A figure's arrays lie in one store by name; a choice of a
run or channel fills the names of what is shown, and `explorers.js` puts that into the figure.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.embed import json_item
from bokeh.layouts import column, row
from bokeh.models import BoxAnnotation, ColumnDataSource, HoverTool, LayoutDOM, PlainText, Span
from bokeh.plotting import figure
from bokeh.resources import Resources
from markupsafe import Markup

from ..discrepancy.diagnosis import Conclusions, ForceTrace, Overlay
from .by_state import state_unit
from .drawing import BASELINE, GREY, IMPROVED, INK, PALE, thinned
from .forces import force_unit, telling_trace
from .overlay import affected_channels, telling_overlay
from .spectra import spectrum
from .text import symbol, unit

# float32 values of all arrays of a figure: a sixth of a page's 3 MB once they are text
_MOST_VALUES = 90_000
_LEAST, _MOST = 100, 2000  # points of one line
_UNITS = {"time": "time (s)", "frequency": "frequency (Hz)", "lag": "lag (s)"}
_COLORS = {"baseline": BASELINE, "improved": IMPROVED}


@dataclasses.dataclass(frozen=True)
class Choice:
    """What a reader chooses: its `name` in patterns, the options as text, and the one that is shown first."""

    name: str
    options: list[str]
    first: int


@dataclasses.dataclass(frozen=True)
class Explorer:
    """A figure with its choices. `data` is what `explorers.js` embeds, as JSON that may stand in a script element."""

    name: str
    choices: list[Choice]
    data: Markup


def script() -> str:
    """Bokeh's script."""
    return Resources(mode="inline", components=["bokeh"]).js_raw[0]


def explorers(diagnosis: Conclusions) -> dict[str, Explorer]:
    """The figures that the diagnosis has data for: `forces` and `residuals`."""
    found = (_forces(diagnosis), _residuals(diagnosis))
    return {one.name: one for one in found if one is not None}


class _Drawing:
    """A figure in the making: what is stored, and which property of which model shows what of it."""

    def __init__(self, name: str, runs: int, arrays: int) -> None:
        """For as many of `runs` as there is room for, each of so many `arrays`."""
        self.name, self.runs = name, max(1, min(runs, _MOST_VALUES // (_LEAST * arrays)))
        self.longest = int(np.clip(_MOST_VALUES // (self.runs * arrays), _LEAST, _MOST))
        self.store: dict[str, Any] = {}
        self.bindings: list[tuple[str, str, str | dict[str, str]]] = []

    def keep(self, place: str, **values: np.ndarray | str | float) -> None:
        """Store arrays, labels and numbers under `place/NAME`."""
        for key, value in values.items():
            # seconds since 1970 need more digits
            kept = value.astype(float if key == "time" else np.float32) if isinstance(value, np.ndarray) else value
            # plain, so that no name is read as a formula
            self.store[f"{place}/{key}"] = PlainText(kept) if isinstance(kept, str) else kept

    def source(self, name: str, columns: Mapping[str, str]) -> ColumnDataSource:
        """A source whose columns follow patterns such as `{run}/{channel}/baseline`."""
        self.bindings.append((name, "data", dict(columns)))
        return ColumnDataSource({key: [] for key in columns}, name=name)

    def panel(self, name: str, x: str, y: str | None, height: int, **settings: Any) -> Any:
        """Axes with a label `x`, and the one `y`: a pattern, or fixed where it has no braces."""
        drawn = figure(
            name=name, height=height, sizing_mode="stretch_width", min_width=280, tools="pan,box_zoom,wheel_zoom,reset",
            active_drag="box_zoom", active_scroll=None, toolbar_location="above", output_backend="canvas", **settings,
        )  # fmt: skip
        drawn.toolbar.logo = None
        for axis, label in ((drawn.xaxis[0], x), (drawn.yaxis[0], y)):
            axis.axis_label_text_font_style = "normal"
            if label and "{" in label:
                axis.name = f"{name}-{type(axis).__name__}-{label}"
                self.bindings.append((axis.name, "axis_label", label))
            elif label:
                axis.axis_label = PlainText(label)
        drawn.add_layout(Span(location=0.0, dimension="width", line_color=GREY, line_width=0.7))
        return drawn

    def band(self, panel: Any, low: str, high: str) -> None:
        """A grey band between two stored numbers."""
        box = BoxAnnotation(
            fill_color=PALE, fill_alpha=0.6, line_color=None, level="underlay", name=f"{panel.name}-band"
        )
        panel.add_layout(box)
        self.bindings += [(str(box.name), "bottom", low), (str(box.name), "top", high)]

    def finished(self, choices: Sequence[Choice], layout: LayoutDOM) -> Explorer:
        """The explorer of a layout of panels, which shows the first options."""
        chosen = {choice.name: choice.first for choice in choices}
        at = lambda pattern: self.store.get(pattern.format(**chosen))
        for name, key, pattern in self.bindings:
            model = layout.select_one({"name": name})
            value = at(pattern) if isinstance(pattern, str) else _padded({c: at(one) for c, one in pattern.items()})
            setattr(model, key, value)
        layout.tags = [self.store, [list(binding) for binding in self.bindings]]
        text = json.dumps(json_item(layout, f"plot-{self.name}")).replace("<", "\\u003c")
        return Explorer(self.name, list(choices), Markup(text))


def _padded(columns: Mapping[str, np.ndarray | None]) -> dict[str, np.ndarray]:
    """Columns of one length: what is not there is missing at every place."""
    length = max((len(values) for values in columns.values() if values is not None), default=0)
    missing = np.full(length, np.nan, np.float32)
    return {name: missing if values is None else values for name, values in columns.items()}


def _lines(panel: Any, source: ColumnDataSource, x: str, columns: Mapping[str, str], dots: Sequence[str] = ()) -> None:
    """Each of `columns` with its colour over `x`, as a line or as `dots`, and values under the pointer."""
    for name, color in columns.items():
        label = name.replace("_", " ")
        if name in dots:
            drawn = panel.scatter(x, name, source=source, size=3.5, color=color, alpha=0.6, legend_label=label)
        else:
            drawn = panel.line(x, name, source=source, color=color, line_width=1.6, legend_label=label)
    values = [(name.replace("_", " "), f"@{name}{{%.4g}}") for name in columns]
    formatters = {f"@{name}": "printf" for name in (x, *columns)}
    mode = "mouse" if dots and len(dots) == len(columns) else "vline"
    hover = HoverTool(
        renderers=[drawn], tooltips=[(_UNITS.get(x, x), f"@{x}{{%.4g}}"), *values], formatters=formatters, mode=mode
    )
    panel.add_tools(hover)
    panel.legend.click_policy = "hide"
    panel.legend.orientation = "horizontal"
    panel.legend.location = "left"
    panel.legend.margin = panel.legend.padding = 0
    panel.legend.border_line_color = None
    panel.add_layout(panel.legend[0], "below")


def _residuals(diagnosis: Conclusions) -> Explorer | None:
    """A channel of a test run, measured and modelled: its residual, and the residual's spectrum and autocorrelation."""
    overlays = [overlay for overlay in diagnosis.overlays if overlay.measured]
    telling = telling_overlay(diagnosis)
    if telling is None:
        return None
    channels = list(telling.measured)
    models = {name: color for name, color in _COLORS.items() if name == "baseline" or diagnosis.improves}
    made = _Drawing("residuals", len(overlays), 8 * len(channels))
    overlays = _chosen(overlays, telling, made.runs)
    for r, overlay in enumerate(overlays):
        for c, channel in enumerate(channels):
            _keep_residual(made, f"{r}/{c}", overlay, channel, models)
    for c, channel in enumerate(channels):
        known = diagnosis.quality.get(channel)
        said, sigma = (f" ({unit(known.unit) or '1'})", 2.0 * known.sigma) if known else ("", 0.0)
        made.keep(f"{c}", value=f"{symbol(channel)}{said}", residual=f"residual{said}", low=-sigma, high=sigma)
        made.keep(f"{c}", density=f"{said.strip() or 'unit'}²/Hz")
        left = {model: one[channel] for model, one in diagnosis.remains.items() if channel in one}
        lags = next(iter(left.values())).delays if left else np.empty(0)
        noise = 2.0 / np.sqrt(max(1, *(one.samples for one in left.values()), 1))
        made.keep(f"{c}", lag=lags, noise=noise, no_noise=-noise, **{m: one.lagged for m, one in left.items()})
    place = "{run}/{channel}"
    over_time = {"time": f"{place}/time", "measured": f"{place}/measured"} | {m: f"{place}/{m}" for m in models}
    values = made.panel("values", "time (s)", "{channel}/value", 300)
    _lines(values, made.source("series", over_time), "time", {"measured": INK, **models}, ("measured",))
    residual = made.panel("residual", "time (s)", "{channel}/residual", 240, x_range=values.x_range)
    columns = {"time": f"{place}/time"} | {m: f"{place}/{m}_residual" for m in models}
    made.band(residual, "{channel}/low", "{channel}/high")
    _lines(residual, made.source("left", columns), "time", models, tuple(models))
    density = made.panel("density", "frequency (Hz)", "{channel}/density", 260, x_axis_type="log", y_axis_type="log")
    columns = {"frequency": f"{place}/frequency"} | {m: f"{place}/{m}_density" for m in models}
    _lines(density, made.source("densities", columns), "frequency", models)
    correlation = made.panel("correlation", "lag (s)", "autocorrelation, all test runs", 260)
    made.band(correlation, "{channel}/no_noise", "{channel}/noise")
    columns = {"lag": "{channel}/lag"} | {m: f"{{channel}}/{m}" for m in models}
    _lines(correlation, made.source("correlations", columns), "lag", models)
    first = channels.index(affected_channels(diagnosis, telling)[0])
    choices = [
        Choice("run", [overlay.run for overlay in overlays], overlays.index(telling)),
        Choice("channel", [symbol(channel) for channel in channels], first),
    ]
    below = row(density, correlation, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"})
    return made.finished(choices, column(values, residual, below, sizing_mode="stretch_width"))


def _chosen(runs: Sequence[Any], telling: Any, most: int) -> list[Any]:
    """The first `most` of `runs`, among them the `telling` one."""
    return [run for i, run in enumerate(runs) if i < most - 1 or run is telling][:most] if most < len(runs) else [*runs]


def _keep_residual(made: _Drawing, place: str, overlay: Overlay, channel: str, models: Mapping[str, str]) -> None:
    measured = overlay.measured.get(channel, np.full_like(overlay.times, np.nan))
    shown = {model: getattr(overlay, model)[channel] for model in models}
    kept = thinned(measured - shown["baseline"], made.longest)
    made.keep(place, time=overlay.times[kept], measured=measured[kept])
    for model, values in shown.items():
        frequency, density = spectrum(overlay.times, measured - values)
        chosen = np.unique(np.geomspace(1, max(density.size, 1), made.longest // 4).astype(int)) - 1
        chosen = chosen[: density.size]
        made.keep(place, frequency=frequency[chosen])
        left = {"": values[kept], "_residual": (measured - values)[kept], "_density": density[chosen]}
        made.keep(place, **{f"{model}{suffix}": one for suffix, one in left.items()})


def _forces(diagnosis: Conclusions) -> Explorer | None:
    """The force that the model lacks in an equation over time, and the added effects' force over a state."""
    telling = telling_trace(diagnosis)
    if telling is None:
        return None
    traces = [trace for trace in diagnosis.forces if trace.force]
    after = {trace.run: trace for trace in diagnosis.remaining_forces} if diagnosis.improves else {}
    equations, states = list(telling.force), list((after.get(telling.run) or telling).states)
    made = _Drawing("forces", len(traces), 8 * len(equations) + len(states))
    traces = _chosen(traces, telling, made.runs)
    for r, trace in enumerate(traces):
        _keep_forces(made, str(r), trace, after.get(trace.run), equations, states)
    for e, equation in enumerate(equations):
        made.keep(f"{e}", force=f"force, {symbol(equation)} ({force_unit(equation)})")
    units = {name: known.unit for name, known in diagnosis.quality.items()}
    for s, state in enumerate(states):
        said = state_unit(state, units)
        made.keep(f"state {s}", value=f"{symbol(state)} ({said})" if said else symbol(state))
    panels = [_over_time(made, bool(after))]
    choices = [Choice("run", [trace.run for trace in traces], traces.index(telling))]
    located = [place.where for place in diagnosis.where if place.where in equations]
    choices.append(Choice("equation", equations, equations.index(located[0]) if located else 0))
    if states:
        modelled = any(trace.modelled for trace in after.values())
        panels.append(_over_state(made, modelled))
        grows = " ".join(diagnosis.where[0].grows_with) if diagnosis.where else ""
        first = next((s for s, state in enumerate(states) if state in grows.replace("*", " ").split()), 0)
        choices.append(Choice("state", [symbol(state) for state in states], first))
    return made.finished(choices, column(*panels, sizing_mode="stretch_width"))


def _keep_forces(
    made: _Drawing,
    run: str,
    trace: ForceTrace,
    after: ForceTrace | None,
    equations: Sequence[str],
    states: Sequence[str],
) -> None:
    for e, equation in enumerate(equations):
        force, band = trace.force[equation], 2.0 * trace.band[equation]
        kept = thinned(force, made.longest)
        made.keep(f"{run}/{e}", time=trace.times[kept], lacking=force[kept], low=(force - band)[kept])
        made.keep(f"{run}/{e}", high=(force + band)[kept])
        if after is not None:
            made.keep(f"{run}/{e}", left=after.force[equation][kept])
    last = after or trace
    even = np.unique(np.linspace(0, len(last.times) - 1, min(made.longest, len(last.times))).astype(int))
    for e, equation in enumerate(equations):
        shown = last.recorded.get(equation, last.force[equation])
        made.keep(f"{run}/{e}", recorded=shown[even])
        if equation in last.modelled:
            made.keep(f"{run}/{e}", modelled=last.modelled[equation][even])
    for s, state in enumerate(states):
        made.keep(f"{run}/state {s}", value=last.states[state][even])


def _over_time(made: _Drawing, improved: bool) -> Any:
    place = "{run}/{equation}"
    lines = {"baseline_lacks": BASELINE} | ({"improved_lacks": IMPROVED} if improved else {})
    columns = {"time": f"{place}/time", "low": f"{place}/low", "high": f"{place}/high"}
    columns |= {"baseline_lacks": f"{place}/lacking"}
    columns |= {"improved_lacks": f"{place}/left"} if improved else {}
    panel = made.panel("missing", "time (s)", "{equation}/force", 300)
    source = made.source("lacking", columns)
    panel.varea("time", "low", "high", source=source, color=BASELINE, alpha=0.2, legend_label="its ±2σ")
    _lines(panel, source, "time", lines)
    return panel


def _over_state(made: _Drawing, modelled: bool) -> Any:
    shown = {"by_the_recordings": BASELINE} | ({"by_the_effects_added": IMPROVED} if modelled else {})
    columns = {"state": "{run}/state {state}/value", "by_the_recordings": "{run}/{equation}/recorded"}
    columns |= {"by_the_effects_added": "{run}/{equation}/modelled"} if modelled else {}
    panel = made.panel("over-state", "state {state}/value", "{equation}/force", 300)
    _lines(panel, made.source("by-state", columns), "state", shown, tuple(shown))
    return panel
