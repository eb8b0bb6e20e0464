"""Monte-Carlo over initial guesses: how often each estimator reaches the global optimum of scenario II."""

import json
import time
from pathlib import Path

import jax
import numpy as np

from jaxsub.cli import terminal
from jaxsub.estimate import METHODS, AbstractMethod, Chain, Global, basins, gauss_newton, mekf, scattered, success

from . import setup
from .figures import rates

SEED, MARGIN = 3, 0.1
# how many starts each estimator is given: as many as minutes allow
COUNTS = {"gauss_newton": 1000, "mekf_then_gauss_newton": 1000, "mekf": 200, "ekf": 200}
COUNTS |= {"global_where_gauss_newton_failed": 8, "newton_eq10": 24, "nelder_mead": 6, "newton": 6, "gradient": 3}
# what takes a minute a start where it does not converge is tried from the nearer starts alone
NEAR_ONLY = ("newton_eq10", "nelder_mead", "newton", "gradient", "global_where_gauss_newton_failed")
QUICK = 8


def run(out: Path, quick: bool) -> dict:
    """Success rates with intervals from ±50 % and ±100 %, basins, and what the global search does with the failures.

    Every line is kept as soon as it is known, so that an interrupted sweep goes on where it stopped.
    """
    problem = setup.problem(setup.truth(), setup.recordings(2, 1))
    best = float(gauss_newton(1e-10).run(problem, scattered(problem, 0.2, 1, SEED)).cost[0])
    kept = out / "parts" / "sweep_lines.json"
    results = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {"50%": {}, "100%": {}}
    for name, count in COUNTS.items():
        for spread, lines in results.items():
            starts = scattered(problem, float(spread[:-1]) / 100.0, max(COUNTS.values()), SEED)
            if name in lines or (spread != "50%" and name in NEAR_ONLY):
                continue
            chosen = starts
            if name.startswith("global"):
                chosen = starts[np.asarray(lines["gauss_newton"]["failed"], int)]
            chosen = chosen[: min(count, QUICK) if quick else count]
            if not len(chosen):
                continue
            begin = time.perf_counter()
            found = jax.block_until_ready(_method(name).run(problem, chosen))
            lines[name] = line(problem, found, best) | {"seconds": time.perf_counter() - begin}
            kept.write_text(json.dumps(results), encoding="utf-8")
            terminal.note(f"±{spread} {name}: {lines[name]['success']}")
    rates(results, out / "sweep.png")
    return {"scenario": 2, "best_cost": best, "success_margin_in_cost": MARGIN, "spread": results}


def _method(name: str) -> AbstractMethod:
    if name == "mekf_then_gauss_newton":
        return Chain(mekf(), gauss_newton())
    return Global(gauss_newton(), span=1.0) if name.startswith("global") else METHODS[name]()


def line(problem, found, best: float) -> dict:
    """Success rate, failures and basins of one estimator."""
    clusters, lost = basins(problem, found)
    cost = np.asarray(found.cost)
    return {
        "success": success(found, best, MARGIN).to_json(),
        "starts": len(cost),
        "failed": np.flatnonzero(~(cost < best + MARGIN)).tolist(),
        "not_finite": lost,
        "below_the_best_known": float(min(0.0, np.nanmin(cost) - best)),
        "basins": [{"cost": basin.cost, "count": basin.count} for basin in clusters[:5]],
        "basins_found": len(clusters),
        "evaluations_median": float(np.median(np.asarray(found.evaluations))),
    }
