"""Monte-Carlo over initial guesses: how often each estimator reaches the global optimum of scenario II."""

import time
from pathlib import Path

import jax
import numpy as np

from jaxsub.cli import session
from jaxsub.estimate import METHODS, Chain, Global, basins, gauss_newton, mekf, scattered, success

from . import setup
from .figures import rates

SEED = 3
# how many starts each estimator is given: as many as minutes allow
COUNTS = {"gauss_newton": 1000, "mekf": 1000, "ekf": 1000, "newton_eq10": 200, "newton": 200, "gradient": 48}
COUNTS |= {"nelder_mead": 48, "mekf_then_gauss_newton": 1000, "global": 24}
QUICK = 16


def run(out: Path, quick: bool) -> dict:
    """Success rates with intervals from ±50 % and ±100 %, basins, and what the global search does with the failures."""
    problem = setup.problem(setup.truth(), setup.recordings(2, 1))
    best = float(gauss_newton(1e-10).run(problem, scattered(problem, 0.2, 1, SEED)).cost[0])
    methods = {name: method() for name, method in METHODS.items()}
    methods["mekf_then_gauss_newton"] = Chain(mekf(), gauss_newton())
    results = {}
    for spread in (0.5, 1.0):
        starts = scattered(problem, spread, max(COUNTS.values()), SEED)
        found, lines = {}, {}
        for name, method in methods.items():
            count = min(COUNTS[name], QUICK if quick else COUNTS[name])
            begin = time.perf_counter()
            found[name] = jax.block_until_ready(method.run(problem, starts[:count]))
            lines[name] = line(problem, found[name], best) | {"seconds": time.perf_counter() - begin}
            session.console.print(f"±{spread:.0%} {name}: {lines[name]['success']}", highlight=False)
        cost = np.asarray(found["gauss_newton"].cost)
        failed = np.flatnonzero(~(cost < best + 0.1))[: 4 if quick else COUNTS["global"]]
        if len(failed):
            begin = time.perf_counter()
            rescued = Global(gauss_newton(), span=1.0).run(problem, starts[failed])
            lines["global_where_gauss_newton_failed"] = line(problem, rescued, best) | {
                "seconds": time.perf_counter() - begin
            }
        results[f"{spread:.0%}"] = lines
    rates(results, out / "sweep.png")
    return {"scenario": 2, "best_cost": best, "success_margin_in_cost": 0.1, "spread": results}


def line(problem, found, best: float) -> dict:
    """Success rate, failures and basins of one estimator."""
    clusters, lost = basins(problem, found)
    cost = np.asarray(found.cost)
    return {
        "success": success(found, best).to_json(),
        "starts": len(cost),
        "not_finite": lost,
        "below_the_best_known": float(min(0.0, np.nanmin(cost) - best)),
        "basins": [{"cost": basin.cost, "count": basin.count} for basin in clusters[:5]],
        "basins_found": len(clusters),
        "evaluations_median": float(np.median(np.asarray(found.evaluations))),
    }
