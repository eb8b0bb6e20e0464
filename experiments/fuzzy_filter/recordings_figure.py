"""Pictures of the filters on real recordings."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

_METHODS = {
    "constant": ("ours, constant noise", "#1f4e79"),
    "fuzzy": ("ours, fuzzy noise", "#7fa7c9"),
    "vqf": ("VQF", "#b5482a"),
    "vqf_without_delay": ("VQF, magnetometer delay removed", "#dd9f8c"),
    "published_madgwick": ("Madgwick, published", "#8a8a8a"),
    "published_mahony": ("Mahony, published", "#c4c4c4"),
}


def draw_broad(path: Path, methods: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    """Total error of each method on each trial, with the part of it that is inclination."""
    shown = {name: look for name, look in _METHODS.items() if name in methods}
    trials = list(methods["constant"])
    figure, axis = plt.subplots(figsize=(11.0, 4.6), layout="constrained")
    width = 0.8 / len(shown)
    for i, (name, (label, colour)) in enumerate(shown.items()):
        places = np.arange(len(trials)) + (i - (len(shown) - 1) / 2.0) * width
        of = methods[name]
        axis.bar(places, [of[t]["total"] for t in trials], 0.9 * width, color=colour, label=label)
        axis.plot(places, [of[t]["inclination"] for t in trials], "_", color="k", ms=9, mew=1.6)
    axis.plot([], [], "_", color="k", ms=9, mew=1.6, label="inclination alone")
    axis.set_xticks(range(len(trials)), [_wrapped(name) for name in trials])
    axis.set_ylabel("orientation error over movement, rms, °")
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, fontsize=9, ncols=2)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _wrapped(name: str) -> str:
    number, kind, *rest = name.split("_")
    return f"{number} {kind}\n{' '.join(rest)}"


class Outage(NamedTuple):
    """A track through an outage, north and east, m.

    **Fields**

    - `name`: of the record. `truth`, `fixes`: (M, 2) the RTK track and the fixes until then.
    - `times`: (K,) s, of them `since` the last fix; `there`: (K, 2) the truth at them.
    - `fused`, `band`: (K, 2) the filter's track and its standard deviations. `others`: (K, 2) by name.
    """

    name: str
    truth: np.ndarray
    fixes: np.ndarray
    times: np.ndarray
    since: float
    there: np.ndarray
    fused: np.ndarray
    band: np.ndarray
    others: Mapping[str, np.ndarray]


_TRACKS = {"last_two_fixes": ("on from the last two fixes", "#8a8a8a"), "no_inertial_unit": ("fixes alone", "#b5482a")}


def draw_ansfl(path: Path, outage: Outage) -> None:
    """The plan of the flight, and north and east against time with the band of two standard deviations."""
    figure = plt.figure(figsize=(13.0, 5.6), layout="constrained")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.3))[0]
    plan, axes = left.subplots(), right.subplots(2, 1, sharex=True)
    dark = outage.times > outage.since
    plan.plot(outage.truth[:, 1], outage.truth[:, 0], color="0.85", lw=3.0, label="RTK")
    plan.plot(outage.there[dark, 1], outage.there[dark, 0], color="0.45", lw=3.0, label="RTK in the outage")
    plan.plot(outage.fixes[:, 1], outage.fixes[:, 0], "+", color="k", ms=6, label="fixes before")
    plan.plot(outage.fused[dark, 1], outage.fused[dark, 0], color="#1f4e79", lw=1.6, label="ours, no fix for 10 s")
    for name, (label, colour) in _TRACKS.items():
        plan.plot(outage.others[name][dark, 1], outage.others[name][dark, 0], "--", color=colour, lw=1.2, label=label)
    plan.set(xlabel="east, m", ylabel="north, m", title=outage.name)
    plan.set_aspect("equal", adjustable="datalim")
    plan.legend(frameon=False, fontsize=8)
    for i, (axis, direction) in enumerate(zip(axes, ("north", "east"), strict=True)):
        low, high = outage.fused[:, i] - 2.0 * outage.band[:, i], outage.fused[:, i] + 2.0 * outage.band[:, i]
        axis.fill_between(outage.times, low, high, color="#1f4e79", alpha=0.18, lw=0.0, label="±2 standard deviations")
        axis.plot(outage.times, outage.there[:, i], color="0.45", lw=2.6, label="RTK")
        axis.plot(outage.times, outage.fused[:, i], color="#1f4e79", lw=1.4, label="ours")
        for name, (label, colour) in _TRACKS.items():
            axis.plot(outage.times, outage.others[name][:, i], "--", color=colour, lw=1.2, label=label)
        axis.axvline(outage.since, color="0.4", lw=1.0, ls=":")
        axis.set_ylabel(f"{direction}, m")
        axis.grid(alpha=0.25)
    axes[0].legend(frameon=False, fontsize=8, ncols=2)
    axes[1].set_xlabel("time, s (dotted: the last fix)")
    figure.savefig(path, dpi=120)
    plt.close(figure)
