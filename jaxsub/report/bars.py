"""Figures that list numbers: the score scan, how far coefficients moved, and what differs by run."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullLocator

from ..discrepancy.records.diagnosis import Candidate, Coefficient, Conclusions
from .drawing import GREY, IMPROVED, LOCATED, PALE, Picture, drawable, new_figure, png
from .text import number, plain_label, power_of_ten, unit

MOST_CANDIDATES = 12
_MOST_COEFFICIENTS = 20
_WIDTH = 4.9


def top_candidates(diagnosis: Conclusions) -> list[Candidate]:
    """The strongest lines of the scan, strongest first."""
    return sorted(diagnosis.candidates, key=lambda candidate: -candidate.statistic)[:MOST_CANDIDATES]


def draw_scan(diagnosis: Conclusions) -> Picture | None:
    """χ² of the strongest candidates on a logarithmic axis, or None when nothing was scanned."""
    candidates = top_candidates(diagnosis)
    if not candidates:
        return None
    colors = {rival.label: LOCATED for found in diagnosis.physics for rival in found.rivals}
    colors |= {found.label: IMPROVED for found in diagnosis.physics}
    figure = new_figure(_WIDTH, 0.27 * len(candidates) + 1.1)
    axes = figure.subplots()
    statistics = [max(candidate.statistic, 1.0) for candidate in candidates]
    axes.barh(range(len(candidates)), statistics, color=[colors.get(c.label, PALE) for c in candidates], height=0.66)
    _rows(axes, [plain_label(candidate.label) for candidate in candidates])
    _logarithmic(axes, max(statistics))
    for row, candidate in enumerate(candidates):
        axes.annotate(
            number(candidate.statistic, 3), (statistics[row], row), (3, 0), textcoords="offset points", va="center",
            fontsize=8,
        )  # fmt: skip
    axes.set_xlabel("χ² that the candidate would explain")
    if colors:
        handles = [Patch(color=IMPROVED, label="accepted"), Patch(color=LOCATED, label="rival"), Patch(color=PALE)]
        handles[-1].set_label("other")
        figure.legend(handles=handles, loc="outside lower left", ncols=3)
    return Picture("scan", "Bars: the chi-square of the strongest candidates of the score scan", png(figure))


def moved_coefficients(diagnosis: Conclusions) -> list[tuple[Coefficient, float, float]]:
    """Coefficient, its change and its new standard error, both in units of the baseline's standard error."""
    moved = []
    for coefficient in diagnosis.coefficients:
        before, after = coefficient.baseline, coefficient.improved
        if before is None or after is None or not 0.0 < before.standard_error < math.inf:
            continue
        change = (after.value - before.value) / before.standard_error
        moved.append((coefficient, change, after.standard_error / before.standard_error))
    return sorted(moved, key=lambda row: -abs(row[1]))[:_MOST_COEFFICIENTS]


def draw_coefficients(diagnosis: Conclusions) -> Picture | None:
    """How far each coefficient moved when the effects were added, or None when nothing was."""
    moved = moved_coefficients(diagnosis) if diagnosis.improves else []
    if not moved:
        return None
    figure = new_figure(_WIDTH, 0.24 * len(moved) + 1.1)
    axes = figure.subplots()
    axes.axvspan(-2.0, 2.0, color=PALE, alpha=0.7, linewidth=0)
    axes.axvline(0.0, color=GREY, linewidth=0.7)
    for row, (_, change, error) in enumerate(moved):
        bar = 2.0 * error if math.isfinite(error) else 0.0
        axes.errorbar(change, row, xerr=bar, fmt="o", color=IMPROVED, markersize=4, linewidth=1.2)
    _rows(axes, [coefficient.name for coefficient, _, _ in moved])
    axes.set_xscale("symlog", linthresh=4.0, linscale=1.5)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 3)))
    axes.xaxis.set_minor_locator(NullLocator())
    ends = [abs(change) + (2.0 * error if math.isfinite(error) else 0.0) for _, change, error in moved]
    _symmetric_ticks(axes, max(ends))
    axes.set_xlabel("improved − baseline, in baseline standard errors")
    handles = [
        Line2D([], [], color=IMPROVED, marker="o", markersize=4, label="change ± 2 new standard errors"),
        Patch(color=PALE, alpha=0.7, label="±2"),
    ]
    figure.legend(handles=handles, loc="outside lower left", ncols=2)
    return Picture("coefficients", "How far each coefficient moved when the effects were added", png(figure))


def draw_by_run(diagnosis: Conclusions) -> Picture | None:
    """Each number that differs by run with its standard error, over the training runs; None when there is none."""
    if not diagnosis.by_run:
        return None
    figure = new_figure(_WIDTH, 1.6 * len(diagnosis.by_run) + 0.6)
    every = np.atleast_1d(figure.subplots(len(diagnosis.by_run), sharex=True))
    for axes, one in zip(every, diagnosis.by_run, strict=True):
        at = np.arange(1, len(one.values) + 1)
        axes.errorbar(at, one.values, yerr=2.0 * one.errors, fmt="o", color=IMPROVED, markersize=3, linewidth=1.0)
        axes.axhline(float(np.mean(one.values)), color=GREY, linewidth=0.7)
        axes.set_title(drawable(f"{one.name} ({unit(one.unit)})" if one.unit else one.name, 60), loc="left")
        axes.ticklabel_format(axis="y", useOffset=False)
    every[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
    every[-1].set_xlabel("training run, in order; ± 2 standard errors")
    return Picture("by-run", "Numbers that differ by run, over the training runs", png(figure))


def _rows(axes: Axes, labels: list[str]) -> None:
    axes.set_yticks(range(len(labels)), [drawable(label, 32) for label in labels])
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _logarithmic(axes: Axes, largest: float) -> None:
    axes.set_xscale("log")
    axes.set_xlim(1.0, max(largest, 10.0) ** 1.18)  # room for the number at the end of the longest bar
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(math.log10(value)))))
    axes.xaxis.set_minor_locator(NullLocator())


def _symmetric_ticks(axes: Axes, largest: float) -> None:
    decades = [10.0**power for power in range(1, 1 + math.ceil(math.log10(max(largest, 10.0))))]
    ticks = [2.0, 4.0, *decades]
    limit = max(1.1 * largest, 4.5)
    shown = [tick for tick in ticks if tick <= limit]
    axes.set_xticks([-tick for tick in reversed(shown)] + [0.0] + shown)
    axes.set_xlim(-limit, limit)
