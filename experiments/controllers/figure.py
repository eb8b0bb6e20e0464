"""The picture of one case: references, what the vehicle did under each controller, the rudder, and the time it took."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from jaxsub.control import Pursuit

_COLOURS = {"baseline": "#b5482a", "improved": "#3b6ea5", "truth": "#7a9a5a"}


def draw(path: Path, name: str, flown: Mapping[str, Pursuit], dt: float) -> None:
    """Write the picture to `path`."""
    figure, axes = plt.subplots(2, 2, figsize=(12.0, 6.5), layout="constrained")
    heading, error, depth, times = axes.ravel()
    first = next(iter(flown.values()))
    t = dt * np.arange(len(first.wanted))
    heading.plot(t, np.degrees(first.wanted[:, 1]), color="black", lw=1.0, ls="--", label="wanted")
    depth.plot(t, first.wanted[:, 0], color="black", lw=1.0, ls="--")
    for kind, flight in flown.items():
        colour = _COLOURS[kind]
        heading.plot(t, np.degrees(flight.truth["psi"]), color=colour, lw=1.2, label=f"model: {kind}")
        error.plot(t, np.degrees(flight.truth["psi"] - flight.wanted[:, 1]), color=colour, lw=1.2)
        depth.plot(t, flight.truth["z"], color=colour, lw=1.2)
        ordered = 1e3 * np.sort(flight.seconds)
        times.plot(ordered, 1.0 - np.arange(len(ordered)) / len(ordered), color=colour, lw=1.2)
    heading.set_ylabel("heading, °")
    error.set_ylabel("heading error, °")
    depth.set_ylabel("depth, m")
    depth.invert_yaxis()
    for axis in (heading, error, depth):
        axis.set_xlabel("time, s")
    times.axvline(1e3 * dt, color="black", lw=0.8, ls=":")
    times.annotate("5 Hz", (1e3 * dt, 0.5), ha="right", rotation=90, fontsize=8)
    times.set_xscale("log")
    times.set_yscale("log")
    times.set_xlabel("wall-clock time of estimate and plan, ms")
    times.set_ylabel("share of samples above")
    heading.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False, fontsize=9)
    error.set_title(f"concealed: {name}", fontsize=10)
    for axis in axes.ravel():
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=120)
    plt.close(figure)
