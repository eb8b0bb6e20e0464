"""Figures like the paper's 2 to 9, each curve a median over noise seeds with its 5-95 % band."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from .bench import DEGREE, INTERVAL, SAMPLES, TURN
from .pitch_runs import STEADY, Runs

_TIME = (np.arange(SAMPLES) - TURN) * INTERVAL
_COLOURS = {"fuzzy": "#b5482a", "random": "#3b6ea5", "consistent": "#2f7d4f", "measured": "#9a9a9a"}
_NAMES = {"fuzzy": "fuzzy, eq. 18", "random": "squared random numbers", "consistent": "consistent fuzzy (ours)"}
_LEGEND = {"frameon": False, "fontsize": 8}
Traces = Mapping[tuple[float, str], Runs]


def draw(out: Path, traces: Traces) -> None:
    """Write `tracking.png` (Figs 2-4), `driving_noise.png` (Figs 6-8) and `steady.png` (Figs 5 and 9)."""
    _save(out / "tracking.png", _tracking, (4.4, 17.4, 28.2), traces)
    _save(out / "driving_noise.png", _driving, (14.1, 35.1, 44.6), traces)
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 3.8), layout="constrained")
    for angle, colour in zip((29.1, 15.7, 3.05), ("#2f7d4f", "#3b6ea5", "#b5482a"), strict=True):
        error = 100.0 * (traces[angle, "fuzzy"].pitch / (angle * DEGREE) - 1.0)
        _band(left, error[:, -STEADY:], colour, f"{angle}°", _TIME[-STEADY:])
    left.set(title="Fuzzy rule in the steady state (the paper's Fig. 5)", xlabel="s after the turn", ylabel="error, %")
    for name in ("random", "fuzzy", "consistent"):
        _band(right, _error(traces[45.7, name], 45.7)[:, -STEADY:], _COLOURS[name], _NAMES[name], _TIME[-STEADY:])
    right.set(title="45.7°, magnified (Fig. 9)", xlabel="s after the turn", ylabel="error, %")
    for axis in (left, right):
        axis.axhline(0.0, color="black", linewidth=0.6)
        axis.legend(**_LEGEND)
    figure.savefig(out / "steady.png", dpi=140)
    plt.close(figure)


def _tracking(axis: Axes, angle: float, traces: Traces) -> None:
    found = traces[angle, "fuzzy"]
    known = found.known[0]
    measured = np.where(found.known, found.measured, np.nan)[:, known] / DEGREE
    axis.fill_between(
        _TIME[known], *np.nanpercentile(measured, [5, 95], axis=0), color=_COLOURS["measured"], alpha=0.25, linewidth=0
    )
    axis.plot(_TIME[known], measured[0], ".", color=_COLOURS["measured"], markersize=3, label="constructed, one seed")
    for name in ("fuzzy", "consistent"):
        _band(axis, traces[angle, name].pitch / DEGREE, _COLOURS[name], _NAMES[name], _TIME)
    axis.set(title=f"{angle}°", xlabel="s after the turn", ylabel="pitch, °", xlim=(-10.0, 60.0))


def _driving(axis: Axes, angle: float, traces: Traces) -> None:
    for name in ("random", "fuzzy", "consistent"):
        _band(axis, _error(traces[angle, name], angle)[:, TURN:], _COLOURS[name], _NAMES[name], _TIME[TURN:])
    axis.axhline(0.0, color="black", linewidth=0.6)
    axis.set(title=f"{angle}°", xlabel="s after the turn", ylabel="error, %", xlim=(0.0, 60.0), ylim=(-100.0, 40.0))


def _error(found: Runs, angle: float) -> np.ndarray:
    return 100.0 * (found.pitch / (angle * DEGREE) - 1.0)


def _band(axis: Axes, values: np.ndarray, colour: str, label: str, times: np.ndarray) -> None:
    low, middle, high = np.percentile(values, [5, 50, 95], axis=0)
    axis.fill_between(times, low, high, color=colour, alpha=0.2, linewidth=0)
    axis.plot(times, middle, color=colour, linewidth=1.3, label=label)


def _save(path: Path, panel, angles: Sequence[float], traces: Traces) -> None:
    figure, axes = plt.subplots(1, len(angles), figsize=(4.0 * len(angles), 3.6), layout="constrained")
    for axis, angle in zip(axes, angles, strict=True):
        panel(axis, angle, traces)
    axes[0].legend(**_LEGEND)
    figure.savefig(path, dpi=140)
    plt.close(figure)
