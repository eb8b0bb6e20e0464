"""A sweep over initial guesses on two cores: this library's pool against CasADi's C, a share in each of two processes.

Both take the same damped Gauss-Newton steps from the same starts to the same tolerance.
"""

import multiprocessing
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits  # pyright: ignore[reportMissingImports]

from jaxsub.cli import terminal
from jaxsub.estimate import Problem

from .case import Case, problem_and_case
from .ours import COUNT, SPREAD, ended, starts_of, swept
from .peers.casadi_fit import SingleShooting
from .peers.casadi_model import Model
from .peers.damped import End
from .timing import once, pin

# s that one side may take; where it would take longer it does as many starts as fit, and the table says how many
_LIMIT, _TRIAL = 90.0, 32
_peer: list[SingleShooting] = []


def run(out: Path, quick: bool) -> dict:
    """Seconds a start, and how many starts end at the least cost known, of both."""
    pin(2)
    problem, case = problem_and_case()
    starts = starts_of(problem, COUNT)
    rows = {}
    for name, make in {"jaxsub": lambda: problem, "jaxsub in C": problem.in_c}.items():
        terminal.note(f"many_starts: {name} …")
        of, made_s = once(make)
        rows[name] = _ours(of, starts, made_s, quick)
    terminal.note("many_starts: CasADi …")
    rows["CasADi C, two processes"] = _two_processes(case, starts[: 4 if quick else COUNT])
    best = min(np.nanmin(row["cost"]) for row in rows.values())
    rows = {name: ended(row, best) for name, row in rows.items()}
    return {
        "cores": 2,
        "spread": SPREAD,
        **rows,
        "times_faster": {
            name: rows["CasADi C, two processes"]["seconds_a_start"] / row["seconds_a_start"]
            for name, row in rows.items()
        },
    }


def _ours(problem: Problem, starts: np.ndarray, made_s: float, quick: bool) -> dict:
    """A sweep of as many starts as there is time for by the speed of a few; made and compiled before."""
    row = swept(problem, starts[: 4 if quick else _TRIAL])
    if not quick:
        row = swept(problem, starts[: 2 * int(min(COUNT, _LIMIT / (row["seconds"] / _TRIAL)) / 2)])
    return row | {"compile_s": made_s + row["compile_s"]}


def _two_processes(case: Case, starts: np.ndarray) -> dict:
    context = multiprocessing.get_context("spawn")
    shares = np.array_split(starts, 2)
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(2, context, _begin, (case, folder)) as pool:
        compile_s = max(pool.map(_warm, [share[:1] for share in shares]))
        begin = time.perf_counter()
        parts = list(pool.map(_share, shares))
        seconds = time.perf_counter() - begin
    ends: list[End] = [end for part in parts for end in part]
    return {
        "starts": len(ends),
        "compile_s": compile_s,
        "seconds": seconds,
        "cost": np.array([end.cost for end in ends]),
        "evaluations_median": float(np.median([end.evaluations for end in ends])),
    }


def _begin(case: Case, folder: str) -> None:
    # a core for each process
    threadpool_limits(1)
    _peer.append(SingleShooting(Model(case), Path(folder)))


def _warm(starts: np.ndarray) -> float:
    _share(starts)
    return sum(_peer[0].compile.values())


def _share(starts: np.ndarray) -> list[End]:
    return [_peer[0].fit(start) for start in starts]
