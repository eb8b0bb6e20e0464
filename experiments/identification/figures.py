"""Figures like the paper's 3 to 6, and what it could not show: success, coverage and drift."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from jaxsub.recording import Recording

_ANGLES = {"delta_r", "delta_er", "delta_el", "phi", "theta", "psi", "p", "q", "r"}
_LABELS = {
    "delta_r": "rudder, °", "delta_er": "right elevator, °", "delta_el": "left elevator, °",
    "r": "yaw rate, °/s", "theta": "pitch, °", "z": "depth, m",
}  # fmt: skip


def histories(recorded: Sequence[Recording], path: Path, title: str) -> None:
    """Deflections and what they did, a column for each run."""
    figure, axes = plt.subplots(
        len(_LABELS), len(recorded), figsize=(5.5 * len(recorded) + 1.5, 9), sharex=True, squeeze=False
    )
    for column, recording in zip(axes.T, recorded, strict=True):
        column[0].set_title(recording.name, fontsize=10)
        for axis, (name, label) in zip(column, _LABELS.items(), strict=True):
            values = recording.column(name)
            held = name.startswith("delta")
            axis.plot(
                recording.times,
                np.degrees(values) if name in _ANGLES else values,
                drawstyle="steps-post" if held else "default",
                color="#b5482a" if held else "#1f4e79",
                lw=0.9,
            )
            axis.set_ylabel(label, fontsize=8)
            axis.tick_params(labelsize=8)
            axis.grid(alpha=0.25)
        column[-1].set_xlabel("time, s")
    figure.suptitle(title)
    _save(figure, path)


def estimates(lines: Mapping[str, Mapping], path: Path, title: str) -> None:
    """Estimate over truth by each estimator, over the band of ±2 standard errors that the data allow."""
    names = list(next(iter(lines.values()))["relative_error"])
    ratios = {name: 1.0 + np.array([line["relative_error"][n] for n in names]) for name, line in lines.items()}
    reach = min(2.0, 1.1 * max(np.nanmax(np.abs(ratio - 1.0)) for ratio in ratios.values()))
    figure, axis = plt.subplots(figsize=(9.5, 0.34 * len(names) + 1.8))
    allowed = 2.0 * np.array([lines["gauss_newton"]["relative_standard_error"][n] for n in names])
    axis.barh(
        range(len(names)), 2.0 * allowed, 0.75, left=1.0 - allowed, color="0.88", label="truth ± 2 standard errors"
    )
    offsets = np.linspace(-0.33, 0.33, len(lines))
    for (method, ratio), offset, marker in zip(ratios.items(), offsets, "ovs^Dx+*P"[: len(lines)], strict=True):
        ratio = np.where(np.isfinite(ratio), ratio, 1.0 + reach)
        shown = np.clip(ratio, 1.0 - reach, 1.0 + reach)
        axis.plot(shown, np.arange(len(names)) + offset, marker, ms=5, label=method.replace("_", " "), alpha=0.85)
    axis.axvline(1.0, color="k", lw=0.8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlim(1.0 - 1.03 * reach, 1.0 + 1.03 * reach)
    axis.set_xlabel("estimate / truth")
    axis.set_title(title)
    axis.grid(axis="x", alpha=0.3)
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    _save(figure, path)


def _save(figure, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def rates(results: Mapping[str, Mapping[str, dict]], path: Path) -> None:
    """Share of starts that reach the global optimum, with 95 % intervals, for each spread."""
    figure, axis = plt.subplots(figsize=(9, 4.8))
    names = list(dict.fromkeys(name for lines in results.values() for name in lines))
    for (spread, lines), shift, colour in zip(results.items(), (-0.17, 0.17), ("#1f4e79", "#b5482a"), strict=True):
        for row, name in enumerate(names):
            if name not in lines:
                continue
            rate = lines[name]["success"]
            low, high = rate["interval"]
            label = f"starts ± {spread}" if row == 0 else None
            axis.barh(row + shift, rate["share"], 0.3, color=colour, label=label)
            axis.plot([low, high], [row + shift] * 2, color="k", lw=1.2)
            axis.text(1.02, row + shift, f"{rate['successes']}/{rate['count']}", va="center", fontsize=8)
    axis.set_yticks(range(len(names)), [name.replace("_", " ") for name in names], fontsize=8)
    axis.invert_yaxis()
    axis.set_xlim(0, 1.12)
    axis.set_xlabel("share of starts that end at the global optimum (within 0.1 of its cost)")
    axis.legend(fontsize=8, loc="center")
    _save(figure, path)


def coverages(results: Mapping, path: Path) -> None:
    """Coverage of nominal 95 % intervals by coefficient; uncorrected, over all, as lines."""
    names = list(results["white"]["by_coefficient"])
    figure, axis = plt.subplots(figsize=(8.5, 0.28 * len(names) + 2.2))
    shown = {"white noise": results["white"]}
    shown |= {f"disturbance of {share}, corrected": line for share, line in results["coloured"].items()}
    for (label, line), colour, marker in zip(shown.items(), ("#1f4e79", "#e0a030", "#b5482a"), "o^s", strict=True):
        shares = [line["by_coefficient"][name] for name in names]
        axis.plot(shares, range(len(names)), marker, color=colour, label=label)
        if "corrected" in label:
            raw = line["raw"]["observed"]
            axis.axvline(
                raw, color=colour, ls=":", label=f"{label.replace('corrected', 'uncorrected, all')}: {raw:.0%}"
            )
    axis.axvline(0.95, color="k", lw=0.8)
    axis.set_yticks(range(len(names)), names, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel("share of nominal 95 % intervals that hold the truth")
    axis.grid(axis="x", alpha=0.3)
    axis.legend(fontsize=8)
    _save(figure, path)


def drifts(cases: Sequence[tuple[dict, str, str, str]], path: Path) -> None:
    """Ends of fits that wandered, in the plane of two coefficients, over the plane's part of the predicted families."""
    figure, axes = plt.subplots(1, len(cases), figsize=(6 * len(cases), 4.8))
    for axis, (found, across, up, title) in zip(axes, cases, strict=True):
        i, j = found["names"].index(across), found["names"].index(up)
        ends = found["ends"]
        axis.plot(
            100 * ends[:, i], 100 * ends[:, j], "o", ms=4, color="#b5482a", alpha=0.7, label="fits, all equally likely"
        )
        # the families seen in this plane: a line where they move both coefficients by one share
        directions = found["tangents"][:, [i, j]]
        _, sizes, rows = np.linalg.svd(directions, full_matrices=False)
        reach = np.abs(ends[:, [i, j]]).max() * 100
        if np.sum(sizes > 1e-6 * sizes[0]) == 1:
            axis.plot(
                *(np.outer([-reach, reach], rows[0]).T),
                color="#1f4e79",
                lw=1,
                label="predicted manifold through the truth",
            )
        else:
            axis.text(0.03, 0.03, "the families fill this plane", transform=axis.transAxes, fontsize=8)
        axis.plot(0, 0, "k+", ms=12, label="truth")
        axis.set_xlabel(f"{across}, % from the truth")
        axis.set_ylabel(f"{up}, % from the truth")
        axis.set_title(title, fontsize=10)
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    _save(figure, path)


def profiles(lines: Sequence, path: Path) -> None:
    """Profile likelihoods with their intervals of 95 %."""
    figure, axes = plt.subplots(1, len(lines), figsize=(3.3 * len(lines), 3.2))
    for axis, line in zip(axes, lines, strict=True):
        axis.plot(line.values, line.rise, "o-", ms=3, color="#1f4e79", lw=1)
        axis.axhline(3.84, color="k", lw=0.7, ls=":")
        axis.axvspan(*line.interval, color="#1f4e79", alpha=0.12)
        axis.set_title(line.name, fontsize=10)
        axis.set_ylabel("twice the rise of -ln L" if axis is axes[0] else "")
        axis.tick_params(labelsize=8)
        axis.grid(alpha=0.3)
    _save(figure, path)


def latencies(milliseconds: np.ndarray, path: Path) -> None:
    """How long steps of the on-line filter take."""
    figure, axis = plt.subplots(figsize=(6.5, 3.2))
    axis.hist(milliseconds, np.geomspace(milliseconds.min() * 0.9, milliseconds.max() * 1.1, 60), color="#1f4e79")
    axis.axvline(1.0, color="k", lw=0.8, ls=":", label="1 ms")
    axis.set_xscale("log")
    axis.set_xlabel("time of a step of the on-line filter, ms")
    axis.set_ylabel("steps")
    axis.legend(fontsize=8)
    _save(figure, path)
