"""The benchmarks as one figure: a fit, a likelihood, a sweep, growth."""

import json
from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

_OURS, _PEER = "#1f4e79", "#b5482a"
_SUBJECTS = {"samples": _OURS, "batch": _PEER, "coefficients": "#5a8f3c", "candidates": "#7a5aa6"}


def run(out: Path, quick: bool) -> dict:
    """Draw the parts that are there."""
    found = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (out / "parts").glob("*.json")}
    draw(found, out / "benchmarks.png")
    return {"drawn": sorted(set(found) - {"figure"})}


def draw(found: Mapping[str, dict], path: Path) -> None:
    """Draw what the parts in `found` measured; a part that is missing leaves its panel empty."""
    figure, axes = plt.subplots(2, 2, figsize=(12.0, 8.4), layout="constrained")
    if "fit" in found:
        _bars(axes[0, 0], _fits(found["fit"]["fits"]), "one fit, one core: seconds")
    if "likelihood" in found:
        rows = {name: row["s"] for name, row in found["likelihood"]["seconds"].items()}
        _bars(axes[0, 1], rows, "one evaluation, one core: seconds", found["likelihood"]["floor"]["s"])
    rows = {}
    for kind, members in found.get("batched", {}).get("seconds_a_member", {}).items():
        rows |= {f"{kind}: {name}": row["s"] for name, row in members.items()}
    if "many_starts" in found:
        rows |= {
            f"fit from a start: {name}": found["many_starts"][name]["seconds_a_start"]
            for name in ("jaxsub", "jaxsub in C", "CasADi C, two processes")
        }
    if rows:
        _bars(axes[1, 0], rows, "a member of a batch, a start of a sweep; two cores: seconds")
    if "growth" in found:
        _growth(axes[1, 1], found["growth"])
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _fits(fits: Mapping[str, dict]) -> dict[str, float]:
    rows = {}
    for name, row in fits.items():
        bound = row.get("more_than_s") or row.get("at_least_s")
        if bound:
            rows[f"{name} (at least)"] = bound
        else:
            far = f" (ends {row['above_best']:.3g} above)" if row["above_best"] > 0.1 else ""
            rows[name + far] = row["s"]
    return rows


def _bars(axis: Axes, rows: Mapping[str, float], title: str, floor: float | None = None) -> None:
    names = list(rows)[::-1]
    values = [rows[name] for name in names]
    axis.barh(names, values, color=[_OURS if "jaxsub" in name else _PEER for name in names], height=0.62)
    for y, value in enumerate(values):
        axis.text(value * 1.1, y, f"{value:.2g}", va="center", fontsize=8)
    if floor:
        axis.axvline(floor, color="0.3", ls=":")
        axis.text(floor * 1.1, len(names) - 0.45, "floor of a likelihood", fontsize=8, color="0.3")
        values = [*values, floor]
    axis.set(xscale="log", title=title, xlim=(min(values) / 2.0, max(values) * 4.0))
    axis.tick_params(axis="y", labelsize=8)
    axis.spines[["top", "right"]].set_visible(False)


def _growth(axis: Axes, grown: Mapping[str, dict]) -> None:
    for what, colour in _SUBJECTS.items():
        rows = grown[what]
        sizes = np.array([int(size) for size in rows["rows"]])
        spent = [np.array([row[key] for row in rows["rows"].values()]) for key in ("s", "least_s", "most_s")]
        axis.fill_between(sizes, spent[1], spent[2], color=colour, alpha=0.2, lw=0.0)
        axis.plot(sizes, spent[0], "o-", color=colour, ms=4, label=f"{what}: slope {rows['slope_of_time']:.2f}")
    axis.set(xscale="log", yscale="log", xlabel="how many", ylabel="seconds", title="growth")
    axis.legend(frameon=False, fontsize=9)
    axis.spines[["top", "right"]].set_visible(False)
