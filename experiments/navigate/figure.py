"""The picture of this experiment: orientation errors by trial and method."""

import json
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


def run(out: Path, quick: bool) -> dict:
    """Draws what the parts `peers` and `broad` found: total errors, with the part of them that is inclination."""
    ours, peers = (
        json.loads((out / "parts" / f"{name}.json").read_text(encoding="utf-8"))["trials"]
        for name in ("broad", "peers")
    )
    trials = {name: peers[name] | scores["rmse_deg"] for name, scores in ours.items()}
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
    figure.savefig(out / "navigate.png", dpi=110)
    plt.close(figure)
    return {}
