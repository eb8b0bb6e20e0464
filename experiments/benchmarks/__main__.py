"""`python -m experiments.benchmarks --out DIR [--quick]`: what a score pass and a whole diagnosis take.

`score_pass`: a pass over 200 candidates against a Gauss-Newton step on the same fit, its first call (compilation
included) against the number of candidates. `diagnose`: the command on three runs of 800 samples, 10 channels and 31
free coefficients, in its own process, with an empty compilation cache and again with a full one.
"""

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

from jaxsub.cli import session
from jaxsub.discrepancy.columns import candidate_columns
from jaxsub.discrepancy.evidence import Evidence
from jaxsub.discrepancy.view import View, facts, look
from jaxsub.effects import AbstractEffect, candidates
from jaxsub.estimate import Problem, fit

from .setup import recordings_and_vehicle, write_files

_REPEATS = 7


def median_seconds(call) -> float:
    """The median time of a call after one that is not counted."""
    call()
    spent = []
    for _ in range(_REPEATS):
        begin = time.perf_counter()
        call()
        spent.append(time.perf_counter() - begin)
    return float(np.median(spent))


def score_pass() -> dict:
    """Time of a Gauss-Newton step and of score passes over 100 and 200 candidates, first calls apart."""
    from jaxsub.discrepancy import batch

    vehicle, recordings = recordings_and_vehicle()
    found = fit(vehicle, batch(vehicle, recordings))
    view = look(found)
    listed = candidates(facts(view))
    first = {}
    for count in (100, 200):
        chosen: list[AbstractEffect] = (listed * 3)[:count]
        jax.clear_caches()
        begin = time.perf_counter()
        score(view, chosen)
        first[str(count)] = time.perf_counter() - begin
    chosen = (listed * 3)[:200]
    problem = Problem.of(found.vehicle, found.runs, found.sigma, found.start)
    step = jax.jit(_gauss_newton_step(problem))
    y = problem.coordinates()
    step_seconds = median_seconds(lambda: jax.block_until_ready(step(y)))
    pass_seconds = median_seconds(lambda: score(view, chosen))
    return {
        "candidates": len(chosen),
        "gauss_newton_step_s": step_seconds,
        "score_pass_s": pass_seconds,
        "ratio": pass_seconds / step_seconds,
        "first_pass_s": first,
    }


def score(view: View, chosen: list[AbstractEffect]) -> None:
    """One pass: the products of all candidates' columns under one disturbance, and every candidate's gain."""
    columns, owners = candidate_columns(view, chosen)
    Evidence.of(view, columns, [view.disturbance]).products[0].gains([], owners)


def _gauss_newton_step(problem: Problem):
    """One step as the search takes it: all columns of the Jacobian and a solve by their Gram matrix."""

    def step(y: jax.Array) -> jax.Array:
        at = problem.expand(y)
        return y - jax.numpy.linalg.solve(at.hessian, at.gradient)

    return step


def whole_diagnosis() -> dict:
    """Wall seconds and peak memory of `jaxsub diagnose`, cold and warm."""
    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write_files(folder)
        environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
        for label in ("cold", "warm"):
            command = [
                sys.executable, "-c", "from jaxsub.cli import main; main()", "diagnose", str(folder / "vehicle.toml"),
                *(str(folder / f"run{i}.csv") for i in (1, 2, 3)), "--out", str(folder / label),
            ]  # fmt: skip
            begin = time.perf_counter()
            subprocess.run(command, env=environment, check=True, capture_output=True)
            verdict = json.loads((folder / label / "diagnosis.json").read_text())
            results[label] = {
                "seconds": time.perf_counter() - begin,
                "verdict": verdict["verdict"],
                "physics": [found["effect"] for found in verdict["physics"]],
            }
        results["peak_memory_GB"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    return results


def main() -> None:
    """Measure and write `results.json`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="the score pass only")
    chosen = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    results: dict = {"python": platform.python_version(), "jax": jax.__version__, "cores": os.cpu_count()}
    if not chosen.quick:
        results["diagnose"] = whole_diagnosis()
    results["score_pass"] = score_pass()
    chosen.out.mkdir(parents=True, exist_ok=True)
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    session.console.print_json(data=results)


if __name__ == "__main__":
    main()
