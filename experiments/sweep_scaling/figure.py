"""The picture of the experiment: time against size by engine, and memory against the batch."""

import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

_COLOURS = {"one_device": "#1f4e79", "two_devices": "#b5482a", "two_workers": "#e0a030", "compiled": "#5a8f3c"}


def draw(out: Path, quick: bool) -> dict:
    """Write `scaling.png` from what the other parts found."""
    read = lambda name: json.loads((out / "parts" / f"{name}.json").read_text(encoding="utf-8"))
    figure, (time, memory) = plt.subplots(1, 2, figsize=(10.5, 4.2), layout="constrained")
    for name, colour in _COLOURS.items():
        found = read(name)
        label = f"{name.replace('_', ' ')}: {found['searches_a_second'][-1]:.1f} a second, slope {found['slope']:.2f}"
        time.loglog(found["searches"], found["seconds"], "o-", ms=4, color=colour, label=label)
    time.set_xlabel("searches")
    time.set_ylabel("time, s, compiled")
    time.legend(fontsize=8)
    found = read("memory")
    label = f"8 lanes, slope {found['slope_by_samples']:.2f}"
    memory.loglog(found["samples"], np.array(found["bytes_by_samples"]) / 1e6, "o-", ms=4, color="#1f4e79", label=label)
    memory.loglog(
        found["samples"], np.array(found["bound_by_samples"]) / 1e6, "k:", lw=1, label="what the sweep reckons"
    )
    memory.set_xlabel("samples of a run")
    memory.set_ylabel("memory of one pool, MB")
    memory.legend(fontsize=8)
    for axes in (time, memory):
        axes.grid(alpha=0.3, which="both")
    figure.savefig(out / "scaling.png", dpi=120)
    plt.close(figure)
    return {"figure": "scaling.png"}
