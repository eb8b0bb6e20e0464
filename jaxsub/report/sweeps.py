"""The figure of a sweep: how high the searches ended, and where."""

import math
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullLocator

from ..sweeps import succeeded
from .drawing import BASELINE, GREY, IMPROVED, PALE, Picture, drawable, new_figure, plain_ticks, png, style
from .text import file_stem, percent, power_of_ten

_LOWEST = 1e-6  # rises of cost below it are rounding
_MOST_COEFFICIENTS, _MOST_POINTS, _REACH = 14, 400, 2.0


def sweep_pictures(dataset: xarray.Dataset, summary: dict[str, Any]) -> list[Picture]:
    """One figure for each vehicle on each set of recordings, named `sweep-VEHICLE-RECORDING`.

    `dataset` has every search and `summary` what `sweep.json` has.
    """
    cases = summary["cases"]
    with style():
        return [_draw(dataset.sel(vehicle=c["vehicle"], recording=c["recording"]), c) for c in cases]


def _draw(case: xarray.Dataset, entry: dict[str, Any]) -> Picture:
    names = _telling(case)
    figure = new_figure(9.8, max(3.2, 0.26 * len(names) + 1.6))
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    _waterfall(left, case, entry)
    _places(right, case, names)
    handles = [
        Line2D([], [], ls="", marker="o", ms=4, color=IMPROVED, label="ends at the least cost known"),
        Line2D([], [], ls="", marker="o", ms=4, color=BASELINE, label="ends elsewhere"),
        Line2D([], [], ls="", marker="|", ms=7, color=GREY, label="starts"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    title = f"{entry['vehicle']} on {entry['recording']}"
    figure.suptitle(drawable(title, 80), x=0.01, ha="left", fontsize=10)
    name = file_stem(f"sweep-{entry['vehicle']}-{entry['recording']}")
    alt = f"How far above the least cost {entry['success']['count']} searches ended, and at which coefficients"
    return Picture(name, alt, png(figure))


def _waterfall(axes: Axes, case: xarray.Dataset, entry: dict[str, Any]) -> None:
    """Rise of the cost over the best of the same recordings, in order: a step is a basin."""
    cost = np.asarray(case.cost.transpose("noise", "start"))
    cost = np.where(np.isfinite(cost), cost, np.inf)
    with np.errstate(invalid="ignore"):
        rise = (cost - cost.min(axis=1, keepdims=True)).ravel()
    good = succeeded(case).ravel()
    order = np.argsort(np.where(np.isfinite(rise), rise, np.inf), kind="stable")
    order = order[np.isfinite(rise[order])]
    rank, height = np.arange(1, len(order) + 1), np.maximum(rise[order], _LOWEST)
    for chosen, color in ((good[order], IMPROVED), (~good[order], BASELINE)):
        axes.plot(rank[chosen], height[chosen], "o", ms=3, color=color, mew=0)
    axes.axhline(entry["margin"], color=GREY, lw=0.8, ls=":")
    axes.set_yscale("log")
    axes.set_ylim(_LOWEST / 2.0, 4.0 * max(float(height.max(initial=1.0)), 1.0))
    axes.set_xlim(0, len(rise) + 1)
    plain_ticks(axes, x=True)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(math.log10(value)))))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_xlabel(f"searches, the lowest first ({len(rise) - len(order)} without an end)")
    axes.set_ylabel("cost above the least known")
    axes.set_title(f"{percent(entry['success']['share'])} succeed (dotted: the margin)")


def _telling(case: xarray.Dataset) -> list[str]:
    """Coefficients that were searched for, those with the widest spread of ends first."""
    ends = np.asarray(case.estimate.transpose("noise", "start", "coefficient")).reshape(-1, case.sizes["coefficient"])
    scale = np.abs(np.asarray(case.file_value))
    finite = np.any(np.isfinite(ends), axis=0)
    width = np.where(finite, _width(np.where(finite, ends, 0.0)) / np.where(scale > 0.0, scale, 1.0), -1.0)
    order = [i for i in np.argsort(-width, kind="stable") if finite[i]][:_MOST_COEFFICIENTS]
    return [str(case.coefficient.values[i]) for i in order]


def _width(ends: np.ndarray) -> np.ndarray:
    low, high = np.nanpercentile(ends, (5, 95), axis=0)
    return high - low


def _places(axes: Axes, case: xarray.Dataset, names: list[str]) -> None:
    """Starts and ends of each coefficient, in units of its value in the vehicle file."""
    good = succeeded(case).ravel()
    shown = np.unique(np.linspace(0, good.size - 1, min(good.size, _MOST_POINTS)).astype(int))
    low = np.inf
    for row, name in enumerate(names):
        own = case.sel(coefficient=name)
        scale = float(own.file_value) or 1.0
        flat = lambda values: np.asarray(values.transpose("noise", "start")).ravel()[shown] / scale  # noqa: B023
        starts, ends = flat(own.initial_guess), np.clip(flat(own.estimate), 1.0 - _REACH, 1.0 + _REACH)
        axes.axhline(row, color=PALE, lw=0.6, zorder=0)
        axes.plot(starts, np.full(starts.size, row + 0.22), "|", ms=5, color=GREY, alpha=0.35)
        for chosen, color in ((~good[shown], BASELINE), (good[shown], IMPROVED)):
            axes.plot(ends[chosen], np.full(chosen.sum(), row - 0.12), "o", ms=3.5, mew=0, color=color, alpha=0.6)
        low = min(low, np.nanmin(ends, initial=1.0))
    axes.set_yticks(range(len(names)), [drawable(name, 32) for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel(f"coefficient / its value in the file (ends farther than {_REACH:g} from 1 drawn there)")
    axes.set_title("where they ended")
    plain_ticks(axes, x=True)
