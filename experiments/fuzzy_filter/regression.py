"""The fuzzy regression against HiGHS and against exact rational arithmetic, and its time."""

import time
from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import block_diag

from jaxsub.filter.regression import fuzzy_line

_SIZES = range(4, 21)
# a deviation is relative to the total spread, or where that is smaller to this share of samples times largest value:
# of samples on a line, rounding alone makes the spread
_SHARE = 1e-5
_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
_Law = Callable[[np.random.Generator, np.ndarray], np.ndarray]
_LAWS: dict[str, _Law] = {
    "gaussian": lambda rng, t: rng.normal(size=t.shape),
    "uniform": lambda rng, t: rng.uniform(-1.0, 1.0, t.shape),
    "heavy tails": lambda rng, t: np.clip(rng.standard_t(2.0, t.shape), -50.0, 50.0),
    "trend": lambda rng, t: 5.0 * rng.normal(size=(len(t), 1)) * t + rng.normal(size=t.shape),
    "random walk": lambda rng, t: np.cumsum(rng.normal(size=t.shape), axis=1),
    "offset": lambda rng, t: 100.0 + rng.normal(size=t.shape),
    "growing": lambda rng, t: t * rng.normal(size=t.shape),
    "quantised": lambda rng, t: np.round(2.0 * rng.normal(size=t.shape)),
    "two values": lambda rng, t: rng.integers(0, 2, t.shape).astype(float),
    "constant": lambda rng, t: np.repeat(rng.normal(size=(len(t), 1)), t.shape[1], axis=1),
    "collinear": lambda rng, t: rng.normal(size=(len(t), 1)) + rng.normal(size=(len(t), 1)) * t,
    "one outlier": lambda rng, t: np.where(np.arange(t.shape[1]) == rng.integers(0, t.shape[1], (len(t), 1)), 1.0, 0.0),
}
_DEGENERATE_LAWS = ("quantised", "two values", "constant", "collinear", "one outlier")
_CLOCKS = ("irregular", "uniform", "duplicates", "all equal")


class Windows(NamedTuple):
    """Windows of one size, and whether each has ties of times or values."""

    times: np.ndarray
    values: np.ndarray
    mask: np.ndarray
    level: np.ndarray
    degenerate: np.ndarray


def windows(count: int, m: int, rng: np.random.Generator) -> Windows:
    """Random windows of `m` samples over all laws and clocks, one in four with missing samples."""
    clock = rng.choice(len(_CLOCKS), count, p=(0.6, 0.2, 0.18, 0.02))
    gaps = np.where(clock[:, None] == 0, rng.uniform(0.02, 1.0, (count, m)), 1.0)
    gaps = np.where(clock[:, None] == 2, rng.integers(0, 2, (count, m)), gaps)
    gaps[clock == 3] = 0.0
    times = np.cumsum(gaps, axis=1) / m + rng.uniform(0.0, 10.0, (count, 1))
    law = rng.integers(0, len(_LAWS), count)
    since = times - times[:, :1]
    values = np.choose(law[:, None], [draw(rng, since) for draw in _LAWS.values()])
    mask = rng.uniform(size=(count, m)) < np.where(rng.uniform(size=(count, 1)) < 0.25, 0.7, 1.0)
    mask[np.arange(count), rng.integers(0, m, count)] = True
    tied = np.isin(law, [list(_LAWS).index(name) for name in _DEGENERATE_LAWS])
    return Windows(times, values, mask, rng.uniform(0.0, 0.95, count), tied | (clock > 0))


def highs(part: Windows) -> np.ndarray:
    """(windows, 4) p₀, p₁, c₀, c₁ by HiGHS, all windows in one block-diagonal program."""
    blocks, bounds, cost = [], [], []
    for times, values, mask, level in zip(*part[:4], strict=True):
        t, x = (times - times[mask].min())[mask], values[mask]
        regressors = np.stack([np.ones_like(t), t], axis=1)
        band = (1.0 - level) * regressors
        blocks.append(np.block([[-regressors, -band], [regressors, -band]]))
        bounds.append(np.concatenate([-x, x]))
        cost.append([0.0, 0.0, len(t), t.sum()])
    free = [(None, None), (None, None), (0.0, None), (0.0, None)] * len(blocks)
    A = block_diag(blocks, format="csr")
    found = linprog(np.concatenate(cost), A, np.concatenate(bounds), bounds=free, method="highs", options=_TOLERANCES)
    assert found.status == 0, found.message
    return found.x.reshape(-1, 4)


def exact(times: np.ndarray, values: np.ndarray) -> Fraction:
    """Least Σ(1 - h)(c₀ + c₁ t) for these numbers, without any rounding, by the dual program.

    The dual's optimum is the samples' number times half the greatest height of their convex hull at or before their
    mean time: a number that the table of slopes never computes.
    """
    samples = sorted({(Fraction(t), Fraction(x)) for t, x in zip(times, values, strict=True)})
    mean = sum((Fraction(t) for t in times), Fraction()) / len(times)
    upper, lower = _chain(samples, 1), _chain(samples, -1)
    places = {t for t, _ in samples if t <= mean} | {mean}
    return len(times) * max(_height(upper, t) - _height(lower, t) for t in places) / 2


def _chain(samples: list[tuple[Fraction, Fraction]], side: int) -> list[tuple[Fraction, Fraction]]:
    outermost: dict[Fraction, Fraction] = {}
    for t, x in samples:
        outermost[t] = side * max(side * x, side * outermost.get(t, x))
    chain: list[tuple[Fraction, Fraction]] = []
    for t, x in outermost.items():
        while len(chain) > 1:
            (t1, x1), (t2, x2) = chain[-2:]
            if side * ((t2 - t1) * (x - x1) - (x2 - x1) * (t - t1)) < 0:
                break
            chain.pop()
        chain.append((t, x))
    return chain


def _height(chain: list[tuple[Fraction, Fraction]], t: Fraction) -> Fraction:
    for (t1, x1), (t2, x2) in pairwise(chain):
        if t1 <= t <= t2:
            return x1 + (x2 - x1) * (t - t1) / (t2 - t1)
    return chain[0][1]


def _total(line: np.ndarray, part: Windows) -> tuple[np.ndarray, np.ndarray]:
    """Total spread of each line (p₀, p₁, c₀, c₁), and by how much its band misses a sample, in largest values."""
    start = np.where(part.mask, part.times, np.inf).min(axis=1, keepdims=True)
    t = np.where(part.mask, part.times - start, 0.0)
    p0, p1, c0, c1 = line.T[:, :, None]
    missed = np.abs(part.values - p0 - p1 * t) - (1.0 - part.level[:, None]) * (c0 + c1 * t)
    total = np.sum(np.where(part.mask, c0 + c1 * t, 0.0), axis=1)
    return total, np.max(np.where(part.mask, missed, -np.inf), axis=1) / _largest(part)


def _largest(part: Windows) -> np.ndarray:
    largest = np.where(part.mask, np.abs(part.values), 0.0).max(axis=1)
    return np.where(largest > 0.0, largest, 1.0)


def _compare(count: int, exactly: int, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Deviations over `count` windows; `exactly` of each size, and the worst ones, in rational arithmetic too."""
    fit = jax.jit(jax.vmap(fuzzy_line))
    rows: dict[str, list[np.ndarray]] = {}
    for m in _SIZES:
        part = windows(-(-count // len(_SIZES)), m, rng)
        line = fit(*map(jnp.asarray, part[:4]))
        ours, ours_missed = _total(np.concatenate([line.centre, line.spread], axis=1), part)
        pieces = np.array_split(np.arange(len(part.times)), max(1, len(part.times) // 300))
        solved = np.concatenate([highs(Windows(*(a[piece] for a in part))) for piece in pieces])
        theirs, theirs_missed = _total(solved, part)
        floor = _SHARE * part.mask.sum(axis=1) * _largest(part) / (1.0 - part.level)
        scale = np.maximum(theirs, floor)
        deviation = (ours - theirs) / scale
        checked = np.union1d(np.arange(exactly), np.argsort(-np.abs(deviation))[:exactly])
        truth = np.full(len(ours), np.nan)
        for i in checked:
            kept = part.mask[i]
            # the quotient is the one rounding
            truth[i] = float(exact(part.times[i][kept], part.values[i][kept]) / (1 - Fraction(float(part.level[i]))))
        for name, column in {
            "deviation": deviation,
            "ours_from_exact": (ours - truth) / scale,
            "highs_from_exact": (theirs - truth) / scale,
            "ours_missed": ours_missed,
            "highs_missed": theirs_missed,
            "degenerate": part.degenerate,
            "on_a_line": theirs < floor,
        }.items():
            rows.setdefault(name, []).append(column)
    return {name: np.concatenate(columns) for name, columns in rows.items()}


def _timing(rng: np.random.Generator, repeats: int) -> dict[str, float]:
    times = np.sort(rng.uniform(size=(10_000, 10)), axis=1)
    part = Windows(times, rng.normal(size=times.shape), np.ones(times.shape, bool), np.zeros(10_000), np.zeros(10_000))
    found = {}
    for precision in (np.float64, np.float32):
        given = [jnp.asarray(a if a.dtype == bool else a.astype(precision)) for a in part[:4]]
        begin = time.perf_counter()
        fit = jax.jit(jax.vmap(fuzzy_line)).lower(*given).compile()
        name = np.dtype(precision).name
        found[f"compile_s_{name}"] = time.perf_counter() - begin
        taken = []
        for _ in range(repeats):
            begin = time.perf_counter()
            jax.block_until_ready(fit(*given))
            taken.append(time.perf_counter() - begin)
        found[f"batch_ms_{name}"] = 1e3 * float(np.median(taken[1:]))
    begin = time.perf_counter()
    for i in range(repeats):
        highs(Windows(*(a[i : i + 1] for a in part)))
    found["highs_ms_a_window"] = 1e3 * (time.perf_counter() - begin) / repeats
    begin = time.perf_counter()
    highs(Windows(*(a[:300] for a in part)))
    found["highs_ms_a_window_in_blocks"] = 1e3 * (time.perf_counter() - begin) / 300
    return found


def _draw(path: Path, rows: dict[str, np.ndarray], rng: np.random.Generator) -> None:
    figure, (left, right) = plt.subplots(1, 2, figsize=(12.0, 4.6), layout="constrained")
    t = np.linspace(0.0, 3.6, 13)
    x = 0.3 + 0.5 * t + (0.15 + 0.25 * t) * rng.uniform(-1.0, 1.0, t.size)
    for level, colour in ((0.5, "#d9e3ec"), (0.0, "#9fb9cf")):
        line = fuzzy_line(jnp.asarray(t), jnp.asarray(x), jnp.ones(t.size, bool), level)
        centre, spread = map(np.asarray, jax.vmap(line.at)(jnp.asarray(t)))
        left.fill_between(t, centre - spread, centre + spread, color=colour, label=f"fuzzy line, h = {level:g}")
        if not level:
            left.plot(t, centre, color="#1f4e79", label="its centre")
    left.plot(t, np.polyval(np.polyfit(t, x, 1), t), "--", color="#b5482a", label="least squares")
    left.plot(t, x, "o", color="k", ms=4, label="samples")
    left.set(xlabel="time in the window, s", ylabel="state residual")
    left.legend(frameon=False, fontsize=9)
    bins = np.linspace(-18.0, -8.0, 61)
    for name, label, colour in (
        ("deviation", "from HiGHS, all windows", "#9fb9cf"),
        ("highs_from_exact", "HiGHS from exact, the worst and a sample", "#b5482a"),
        ("ours_from_exact", "ours from exact, the worst and a sample", "#1f4e79"),
    ):
        sizes = np.abs(rows[name][np.isfinite(rows[name])])
        filled = name == "deviation"
        right.hist(
            np.log10(np.maximum(sizes, 10.0 ** bins[0])),
            bins,
            histtype="stepfilled" if filled else "step",
            color=colour,
            lw=1.4,
            label=label,
        )
    right.axvline(-9.0, color="0.4", lw=1.0, ls=":")
    right.set(yscale="log", xlabel="log₁₀ relative deviation of the total spread (−18: none)", ylabel="windows")
    right.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=120)
    plt.close(figure)


def run(out: Path, quick: bool) -> dict:
    """Compare, time and draw; the numbers."""
    rng = np.random.default_rng(1982)
    rows = _compare(2_000 if quick else 102_000, 20 if quick else 600, rng)
    timing = _timing(rng, 20 if quick else 200)
    _draw(out / "fuzzy_regression.png", rows, rng)
    return {
        "windows": len(rows["deviation"]),
        "degenerate": int(rows["degenerate"].sum()),
        "windows_on_a_line": int(rows["on_a_line"].sum()),
        "exact_windows": int(np.isfinite(rows["ours_from_exact"]).sum()),
        "max_relative_deviation": float(np.abs(rows["deviation"]).max()),
        "max_relative_deviation_degenerate": float(np.abs(rows["deviation"][rows["degenerate"]]).max()),
        "max_relative_deviation_of_spread_alone": float(np.abs(rows["deviation"][~rows["on_a_line"]]).max()),
        "ours_from_exact": float(np.nanmax(np.abs(rows["ours_from_exact"]))),
        "highs_from_exact": float(np.nanmax(np.abs(rows["highs_from_exact"]))),
        "ours_band_misses_by": float(rows["ours_missed"].max()),
        "highs_band_misses_by": float(rows["highs_missed"].max()),
        **timing,
    }
