"""Figures that zoom, show values under the pointer, and switch between runs, channels and equations."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..discrepancy.records.diagnosis import Conclusions, ForceTrace, Overlay
from .by_state import state_unit
from .drawing import BASELINE, IMPROVED, INK, thinned
from .exploring import Choice, Drawing, Explorer, lines, tips
from .forces import force_unit, telling_trace
from .overlay import affected_channels, telling_overlay
from .spectra import spectrum
from .text import symbol, unit

_TIME, _FREQUENCY, _LAG = ("time", "time", "s"), ("frequency", "frequency", "Hz"), ("lag", "lag", "s")
_COLORS = {"baseline": BASELINE, "improved": IMPROVED}


def explorers(diagnosis: Conclusions) -> dict[str, Explorer]:
    """The figures that the diagnosis has data for: `forces` and `residuals`."""
    found = (_forces(diagnosis), _residuals(diagnosis))
    return {one.name: one for one in found if one is not None}


def _residuals(diagnosis: Conclusions) -> Explorer | None:
    """A channel of a test run, measured and modelled: its residual, and the residual's spectrum and autocorrelation."""
    from bokeh.layouts import column, row

    overlays = [overlay for overlay in diagnosis.overlays if overlay.measured]
    telling = telling_overlay(diagnosis)
    if telling is None:
        return None
    channels = list(telling.measured)
    models = {name: color for name, color in _COLORS.items() if name == "baseline" or diagnosis.improves}
    made = Drawing("residuals", len(overlays), 8 * len(channels))
    overlays = _chosen(overlays, telling, made.runs)
    for r, overlay in enumerate(overlays):
        for c, channel in enumerate(channels):
            _keep_residual(made, f"{r}/{c}", overlay, channel, models)
    for c, channel in enumerate(channels):
        known = diagnosis.quality.get(channel)
        said, sigma = (f" ({unit(known.unit) or '1'})", 2.0 * known.sigma) if known else ("", 0.0)
        made.keep(f"{c}", value=f"{symbol(channel)}{said}", residual=f"residual{said}", low=-sigma, high=sigma)
        squared, own = f"{said.strip() or 'unit'}²/Hz", unit(known.unit) if known else ""
        made.keep(f"{c}", density=squared)
        made.keep(f"{c}/tips", values=tips(_TIME, ("measured", *models), own), residual=tips(_TIME, models, own))
        made.keep(f"{c}/tips", density=tips(_FREQUENCY, models, squared), correlation=tips(_LAG, models, ""))
        left = {model: one[channel] for model, one in diagnosis.remains.items() if channel in one}
        lags = next(iter(left.values())).delays if left else np.empty(0)
        noise = 2.0 / np.sqrt(max(1, *(one.samples for one in left.values()), 1))
        made.keep(f"{c}", lag=lags, noise=noise, no_noise=-noise, **{m: one.lagged for m, one in left.items()})
    place = "{run}/{channel}"
    over_time = {"time": f"{place}/time", "measured": f"{place}/measured"} | {m: f"{place}/{m}" for m in models}
    values = made.panel("values", "time (s)", "{channel}/value", 300)
    measured = {"measured": INK, **models}
    lines(made, values, made.source("series", over_time), "time", measured, "{channel}/tips/values", ("measured",))
    residual = made.panel("residual", "time (s)", "{channel}/residual", 240, x_range=values.x_range)
    columns = {"time": f"{place}/time"} | {m: f"{place}/{m}_residual" for m in models}
    made.band(residual, "{channel}/low", "{channel}/high")
    lines(made, residual, made.source("left", columns), "time", models, "{channel}/tips/residual", tuple(models))
    density = made.panel("density", "frequency (Hz)", "{channel}/density", 260, x_axis_type="log", y_axis_type="log")
    columns = {"frequency": f"{place}/frequency"} | {m: f"{place}/{m}_density" for m in models}
    lines(made, density, made.source("densities", columns), "frequency", models, "{channel}/tips/density")
    correlation = made.panel("correlation", "lag (s)", "autocorrelation, all test runs", 260)
    made.band(correlation, "{channel}/no_noise", "{channel}/noise")
    columns = {"lag": "{channel}/lag"} | {m: f"{{channel}}/{m}" for m in models}
    lines(made, correlation, made.source("correlations", columns), "lag", models, "{channel}/tips/correlation")
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


def _keep_residual(made: Drawing, place: str, overlay: Overlay, channel: str, models: Mapping[str, str]) -> None:
    measured = overlay.measured.get(channel, np.full_like(overlay.times, np.nan))
    shown = {model: getattr(overlay, model)[channel] for model in models}
    kept = thinned(measured - shown["baseline"], made.longest)
    made.keep(place, time=overlay.times[kept], measured=measured[kept])
    spectra = {model: spectrum(overlay.times, measured - values) for model, values in shown.items()}
    frequency = max((own for own, _ in spectra.values()), key=len)
    chosen = np.unique(np.geomspace(1, max(frequency.size, 1), made.longest // 4).astype(int)) - 1
    chosen = chosen[: frequency.size]
    made.keep(place, frequency=frequency[chosen])
    for model, values in shown.items():
        at, own = spectra[model]
        # one that diverged on the way has coarser frequencies of its own, or none
        density = np.interp(frequency, at, own, np.nan, np.nan) if at.size else np.full(frequency.size, np.nan)
        left = {"": values[kept], "_residual": (measured - values)[kept], "_density": density[chosen]}
        made.keep(place, **{f"{model}{suffix}": one for suffix, one in left.items()})


def _forces(diagnosis: Conclusions) -> Explorer | None:
    """The force that the model lacks in an equation over time, and the added effects' force over a state."""
    from bokeh.layouts import column

    telling = telling_trace(diagnosis)
    if telling is None:
        return None
    traces = [trace for trace in diagnosis.forces if trace.force]
    after = {trace.run: trace for trace in diagnosis.remaining_forces} if diagnosis.improves else {}
    equations, states = list(telling.force), list((after.get(telling.run) or telling).states)
    made = Drawing("forces", len(traces), 8 * len(equations) + len(states))
    traces = _chosen(traces, telling, made.runs)
    for r, trace in enumerate(traces):
        _keep_forces(made, str(r), trace, after.get(trace.run), equations, states)
    for e, equation in enumerate(equations):
        made.keep(f"{e}", force=f"force, {symbol(equation)} ({force_unit(equation)})")
        made.keep(f"{e}/tips", time=tips(_TIME, _lacking(bool(after)), force_unit(equation)))
    units = {name: known.unit for name, known in diagnosis.quality.items()}
    modelled = any(trace.modelled for trace in after.values())
    for s, state in enumerate(states):
        said = state_unit(state, units)
        made.keep(f"state {s}", value=f"{symbol(state)} ({said})" if said else symbol(state))
        for e, equation in enumerate(equations):
            over = tips(("state", symbol(state), said), _by_state(modelled), force_unit(equation))
            made.keep(f"{e}/state {s}", tips=over)
    panels = [_over_time(made, bool(after))]
    choices = [Choice("run", [trace.run for trace in traces], traces.index(telling))]
    located = [place.where for place in diagnosis.where if place.where in equations]
    choices.append(Choice("equation", equations, equations.index(located[0]) if located else 0))
    if states:
        panels.append(_over_state(made, modelled))
        grows = " ".join(diagnosis.where[0].grows_with) if diagnosis.where else ""
        first = next((s for s, state in enumerate(states) if state in grows.replace("*", " ").split()), 0)
        choices.append(Choice("state", [symbol(state) for state in states], first))
    return made.finished(choices, column(*panels, sizing_mode="stretch_width"))


def _keep_forces(
    made: Drawing,
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


def _over_time(made: Drawing, improved: bool) -> Any:
    place = "{run}/{equation}"
    columns = {"time": f"{place}/time", "low": f"{place}/low", "high": f"{place}/high"}
    columns |= {"baseline_lacks": f"{place}/lacking"}
    columns |= {"improved_lacks": f"{place}/left"} if improved else {}
    panel = made.panel("missing", "time (s)", "{equation}/force", 300)
    source = made.source("lacking", columns)
    panel.varea("time", "low", "high", source=source, color=BASELINE, alpha=0.2, legend_label="its ±2σ")
    lines(made, panel, source, "time", _lacking(improved), "{equation}/tips/time")
    return panel


def _lacking(improved: bool) -> dict[str, str]:
    return {"baseline_lacks": BASELINE} | ({"improved_lacks": IMPROVED} if improved else {})


def _by_state(modelled: bool) -> dict[str, str]:
    return {"by_the_recordings": BASELINE} | ({"by_the_effects": IMPROVED} if modelled else {})


def _over_state(made: Drawing, modelled: bool) -> Any:
    shown = _by_state(modelled)
    columns = {"state": "{run}/state {state}/value", "by_the_recordings": "{run}/{equation}/recorded"}
    columns |= {"by_the_effects": "{run}/{equation}/modelled"} if modelled else {}
    panel = made.panel("over-state", "state {state}/value", "{equation}/force", 300)
    source, pattern = made.source("by-state", columns), "{equation}/state {state}/tips"
    lines(made, panel, source, "state", shown, pattern, tuple(shown))
    return panel
