"""What a score pass and a whole diagnosis take, and what the same costs by refitting every candidate."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

from jaxsub.cli import main as command_line
from jaxsub.discrepancy.linearise.columns import candidate_columns
from jaxsub.discrepancy.linearise.evidence import Evidence
from jaxsub.discrepancy.linearise.view import View, facts, look
from jaxsub.effects import AbstractEffect, candidates
from jaxsub.estimate import Problem, fit

from .setup import recordings_and_vehicle, write_files
from .timing import once, spread_of, timed


def score_pass(out: Path, quick: bool) -> dict:
    """A Gauss-Newton step and score passes over 100 and 200 candidates, first calls apart; refits of a few of them."""
    vehicle, recordings = recordings_and_vehicle()
    found = fit(vehicle, recordings)
    view = look(found)
    listed = candidates(facts(view))
    first = {}
    for count in (200,) if quick else (100, 200):
        jax.clear_caches()
        first[str(count)] = once(lambda count=count: score(view, (listed * 3)[:count]))[1]
    chosen = (listed * 3)[:200]
    problem = Problem.of(found.vehicle, found.runs, found.sigma, found.start)
    step = jax.jit(_gauss_newton_step(problem))
    y = problem.coordinates()
    repeats = 3 if quick else 7
    step_seconds = timed(lambda: step(y), repeats)
    pass_seconds = timed(lambda: score(view, chosen), repeats)
    refits = refitted(found, listed, 1 if quick else 6)
    whole = len(chosen) * refits["first_s"]["s"]
    return {
        "candidates": len(chosen),
        "gauss_newton_step": step_seconds,
        "score_pass": pass_seconds,
        "ratio": pass_seconds["s"] / step_seconds["s"],
        "first_pass_s": first,
        "refit_one": refits,
        "refit_all_s": whole,
        "times_faster_than_refits": whole / pass_seconds["s"],
        "times_faster_than_compiled_refits": len(chosen) * refits["again_s"]["s"] / pass_seconds["s"],
    }


def score(view: View, chosen: list[AbstractEffect]) -> None:
    """One pass: the products of all candidates' columns under one disturbance, and every candidate's gain."""
    columns, owners = candidate_columns(view, chosen)
    Evidence.of(view, columns, [view.disturbance]).products[0].gains([], owners)


def refitted(found, listed: list[AbstractEffect], count: int) -> dict:
    """Fits with one candidate in the model, as one asks without a score: each is a program of its own to compile."""
    forces = [effect for effect in listed if effect.where and ":" not in effect.where[0]]
    chosen = [forces[i] for i in np.linspace(0, len(forces) - 1, count).astype(int)]
    first, again = [], []
    for effect in chosen:
        vehicle = found.vehicle.with_effect(effect)
        first.append(once(lambda vehicle=vehicle: fit(vehicle, found.runs).cost)[1])
        again.append(once(lambda vehicle=vehicle: fit(vehicle, found.runs).cost)[1])
    return {"candidates": [e.label for e in chosen], "first_s": spread_of(first), "again_s": spread_of(again)}


def _gauss_newton_step(problem: Problem):
    """One step as the search takes it: all columns of the Jacobian and a solve by their Gram matrix."""

    def step(y: jax.Array) -> jax.Array:
        at = problem.expand(y)
        return y - jax.numpy.linalg.solve(at.hessian, at.gradient)

    return step


def whole(out: Path, quick: bool) -> dict:
    """`jaxsub diagnose` in its own process, with an empty compilation cache and with a full one.

    Wall seconds, peak memory, and of the seconds those that JAX takes to make programs: it traces and lowers each, and
    compiles it or reads it from the cache.
    """
    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write_files(folder)
        environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
        for label in ("cold", "warm"):
            command = [
                sys.executable, "-m", "experiments.benchmarks.diagnosis", "diagnose", str(folder / "vehicle.toml"),
                *(str(folder / f"run{i}.csv") for i in (1, 2, 3)), "--out", str(folder / label),
            ]  # fmt: skip
            begin = time.perf_counter()
            process = subprocess.run(
                command, env=environment, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
            verdict = json.loads((folder / label / "diagnosis.json").read_text())
            making = json.loads(process.stdout.splitlines()[-1])
            results[label] = {
                "seconds": time.perf_counter() - begin,
                "programs": int(making.pop("programs")),
                "making_programs_s": making,
                "verdict": verdict["verdict"],
                "physics": [found["effect"] for found in verdict["physics"]],
            }
        results["peak_memory_GB"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    return results


# JAX's name for each part of making a program; a program that is read from the cache counts as compiled as well
_PARTS = {"jaxpr_trace": "trace", "jaxpr_to_mlir_module": "lower", "backend_compile": "compile_or_read"}


def _told_apart() -> None:
    """Runs the command line, and prints how long JAX took to make its programs."""
    spent = {"programs": 0.0, **dict.fromkeys(_PARTS.values(), 0.0)}

    def note(event: str, duration_secs: float, **_) -> None:
        for words, part in _PARTS.items():
            if f"/{words}_duration" in event:
                spent[part] += duration_secs
                spent["programs"] += part == "compile_or_read"

    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        command_line()
    finally:
        sys.stdout.write(f"\n{json.dumps(spent)}\n")


if __name__ == "__main__":
    _told_apart()
