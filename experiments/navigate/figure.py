"""The picture of this experiment: orientation errors by trial and method."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

_METHODS = {
    "filter": ("jaxsub navigate, filter", "#1f4e79"),
    "vqf": ("VQF on line", "#b5482a"),
    "published_madgwick": ("Madgwick, published", "#8a8a8a"),
    "published_mahony": ("Mahony, published", "#c4c4c4"),
    "smoother": ("jaxsub navigate, smoother", "#7fa7c9"),
    "vqf_offline_without_delay": ("VQF off line, delay removed", "#dd9f8c"),
}


def draw(path: Path, trials: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    """Total error of each method on each trial, with the part of it that is inclination."""
    figure, axis = plt.subplots(figsize=(11.0, 4.6), layout="constrained")
    width = 0.8 / len(_METHODS)
    for i, (name, (label, colour)) in enumerate(_METHODS.items()):
        places = np.arange(len(trials)) + (i - (len(_METHODS) - 1) / 2.0) * width
        axis.bar(places, [of[name]["total"] for of in trials.values()], 0.9 * width, color=colour, label=label)
        inclination = [of[name]["inclination"] for of in trials.values()]
        axis.plot(places, inclination, "_", color="k", ms=9, mew=1.6, label="inclination alone" if not i else None)
    axis.set_xticks(range(len(trials)), [name.replace("_", " ", 1).replace("_", "\n", 1) for name in trials])
    axis.set_ylabel("orientation error over movement, rms, °")
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(frameon=False, fontsize=9, ncols=2)
    figure.savefig(path, dpi=110)
    plt.close(figure)
