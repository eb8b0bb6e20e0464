"""The story at a glance, and whether stated probabilities are true."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

_PEERS = {"pysindy": "PySINDy", "stepwise_aic": "stepwise AIC", "stepwise_bic": "stepwise BIC"}
_COLOURS = {"jaxsub": "#1f4e79", "pysindy": "#b5482a", "stepwise_aic": "#c9a227", "stepwise_bic": "#7a8b69"}


def draw(results: dict, folder: Path) -> None:
    """`story.png` and `calibration.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    figure, axes = plt.subplots(1, 2, figsize=(15, 10), width_ratios=[1.0, 1.15], layout="constrained")
    _heat(results["recovery"], axes[0])
    _table(results, axes[1])
    figure.savefig(folder / "story.png", dpi=110)
    plt.close(figure)
    figure, axis = plt.subplots(figsize=(5.5, 5), layout="constrained")
    _calibration(results["calibration"], axis)
    figure.savefig(folder / "calibration.png", dpi=110)
    plt.close(figure)


def _heat(recovery: dict, axis) -> None:
    """Share right by effect and size, with the number of cases in each cell."""
    sizes = sorted({float(size) for row in recovery.values() for size in row})
    table = np.full((len(recovery), len(sizes)), np.nan)
    for i, row in enumerate(recovery.values()):
        for size, cell in row.items():
            j = sizes.index(float(size))
            table[i, j] = cell["rate"]
            colour = "white" if cell["rate"] > 0.6 else "black"
            axis.text(j, i, f"{round(cell['rate'] * cell['n'])}/{cell['n']}", ha="center", va="center", fontsize=7,
                      color=colour)  # fmt: skip
    if table.size:
        axis.imshow(table, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    axis.set_facecolor("0.95")
    axis.set_xticks(range(len(sizes)), [f"{size:g}" for size in sizes])
    axis.set_yticks(range(len(recovery)), list(recovery), fontsize=8)
    axis.set_xlabel("size of the effect, σ of its most affected channel after a refit")
    axis.set_title("named (or among ≤ 4 rivals), one effect, white noise", fontsize=10)


def _table(results: dict, axis) -> None:
    """Share right in each condition with its 95 % interval and target, the peers' beside it."""
    whose = {"jaxsub": results["conditions"]} | {p: results["peers"][p]["conditions"] for p in _PEERS}
    judged = [i for i, row in enumerate(results["conditions"]) if row["n"]]
    answerers = {who: [rows[i] for i in judged] for who, rows in whose.items()}
    high = 0.8 / len(answerers)
    for k, (who, rows) in enumerate(answerers.items()):
        label = _PEERS.get(who, who)
        for i, row in enumerate(rows):
            score, y = row["right"], i - 0.4 + (k + 0.5) * high
            if score["rate"] is None:
                continue
            axis.barh(y, score["rate"], 0.9 * high, color=_COLOURS[who], label=label)
            label = None
            low, top = score["interval"]
            axis.plot([low, top], [y, y], color="0.2", lw=1.2)
    for i, row in enumerate(answerers["jaxsub"]):
        if row["target"] is None:
            continue
        axis.plot([row["target"]] * 2, [i - 0.45, i + 0.45], color="k", lw=2, label="target" if i == 0 else None)
    labels = [f"{row['condition']}\n(n = {row['n']})" for row in answerers["jaxsub"]]
    axis.set_yticks(range(len(labels)), labels, fontsize=8)
    axis.set_ylim(len(labels) - 0.5, -0.5)
    axis.set_xlim(0.0, 1.02)
    axis.set_xlabel("share right")
    axis.set_title("by condition, with 95 % intervals", fontsize=10)
    axis.grid(axis="x", alpha=0.3)
    axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=5)


def _calibration(bins: list[dict], axis) -> None:
    """Stated against observed, the size of a point with the number of statements."""
    axis.plot([0, 1], [0, 1], color="0.6", lw=1)
    axis.fill_between([0, 1], [-0.05, 0.95], [0.05, 1.05], color="0.9", label="± 5 points")
    for cell in bins:
        low, high = cell["interval"]
        axis.plot([cell["stated"]] * 2, [low, high], color="#1f4e79", lw=1.2)
        axis.plot(cell["stated"], cell["rate"], "o", color="#1f4e79", ms=4)
        axis.annotate(f" {cell['n']}", (cell["stated"], cell["rate"]), fontsize=7)
    axis.set(xlim=(0, 1.02), ylim=(0, 1.02), xlabel="stated probability", ylabel="observed share")
    axis.set_title("probabilities of names, rivals included", fontsize=10)
    axis.legend(fontsize=8, loc="upper left")
