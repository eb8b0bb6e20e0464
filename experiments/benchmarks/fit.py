"""One fit, 25 free coefficients 20 % off and three runs of 800 samples, by this library and by what else one would use.

Peers are paired on one core. Each starts at the same coordinates, and ends with the cost that this library's likelihood
has where it ended: a peer that ends above the best has not done the same work, and the table says by how much.
"""

import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.cli import terminal
from jaxsub.estimate import Problem, gauss_newton

from .case import Case, problem_and_case
from .peers import scipy_fit, sysid_fit
from .peers.casadi_fit import MultipleShooting, SingleShooting
from .peers.casadi_model import Model
from .peers.damped import End
from .timing import once, pin, spread_of

# s that SciPy may take as its users write it, and the evaluations of L-BFGS that jax-sysid gets
_LIMIT, _EPOCHS = 420.0, 1000
_STRIDES = (1, 10)


def run(out: Path, quick: bool) -> dict:
    """Every peer's seconds, evaluations and end."""
    cores = pin(1)
    problem, case = problem_and_case()
    z = np.zeros(case.size)
    repeats = 1 if quick else 5
    found: dict[str, dict] = {}

    def measure(name: str, prepare: Callable[[], tuple[Callable[[], End], dict]], times: int = repeats) -> None:
        terminal.note(f"fit: {name} …")
        try:
            fit, before = prepare()
            first = once(fit)[1]
            ends, spent = zip(*[once(fit) for _ in range(times)], strict=True) if times else ([once(fit)[0]], [first])
        except scipy_fit.TimeLimitError:
            found[name] = {"more_than_s": _LIMIT}
            return
        end = ends[-1]
        row = {"first_s": first, **spread_of(list(spent)), "compile": before, "evaluations": end.evaluations}
        found[name] = row | {"cost": float(problem.cost(jnp.asarray(end.z))), "error": _error(case, end.z)}

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        measure("jaxsub", lambda: (lambda: _ours(problem), {}), max(repeats, 3))
        measure("jaxsub in C", lambda: _ours_in_c(problem), max(repeats, 3))
        measure("CasADi C, Gauss-Newton by hand", lambda: _prepared(SingleShooting(Model(case), folder), z))
        for stride in _STRIDES[:1] if quick else _STRIDES:
            shooting = lambda stride=stride: _prepared(MultipleShooting(Model(case), folder, stride), z)
            measure(f"CasADi IPOPT, node every {stride}", shooting, min(repeats, 3))
        measure("SciPy, stacked by an expert", lambda: (lambda: scipy_fit.Stacked(case).fit(z), {}), 0 if quick else 1)
        if quick:
            found["SciPy as users write it"] = _scipy_by_one_step(case, z)
        else:
            measure("SciPy as users write it", lambda: (lambda: scipy_fit.Serial(case, _LIMIT).fit(z), {}), 0)
        epochs = 50 if quick else _EPOCHS
        measure("jax-sysid, L-BFGS", lambda: (lambda: sysid_fit.fit(case, z, epochs), {}), 0)
    best = min(row["cost"] for row in found.values() if "cost" in row)
    for row in found.values():
        if "cost" in row:
            row["above_best"] = row["cost"] - best
    ours, in_c = (found[name]["s"] for name in ("jaxsub", "jaxsub in C"))
    taken = {name: row.get("s") or row.get("more_than_s") or row["at_least_s"] for name, row in found.items()}
    return {
        "cores": cores,
        "versions": {name: version(name) for name in ("casadi", "scipy", "jax-sysid")},
        "free": len(case.names),
        "samples": list(case.measured.shape[:2]),
        "fits": found,
        "times_ours": {name: seconds / ours for name, seconds in taken.items()},
        "times_ours_in_C": {name: seconds / in_c for name, seconds in taken.items()},
        "dynax": "the package of that name in the registry (0.0.1) is another's, and empty: it has no module",
    }


def _ours(problem: Problem) -> End:
    ended = jax.block_until_ready(gauss_newton().run(problem, problem.coordinates()[None]).one(0))
    return End(np.asarray(ended.y), float(ended.cost), int(ended.evaluations))


def _ours_in_c(problem: Problem) -> tuple[Callable[[], End], dict]:
    fast, seconds = once(problem.in_c)
    return lambda: _ours(fast), {"made_s": seconds}


def _prepared(peer: SingleShooting | MultipleShooting, z: np.ndarray) -> tuple[Callable[[], End], dict]:
    return lambda: peer.fit(z), peer.compile


def _scipy_by_one_step(case: Case, z: np.ndarray) -> dict[str, float]:
    """A lower bound: one Jacobian by differences and as few steps as Gauss and Newton need, from one evaluation."""
    seconds = once(lambda: scipy_fit.Serial(case).residuals(z))[1]
    return {"residuals_s": seconds, "at_least_s": 5 * (case.size + 1) * seconds}


def _error(case: Case, z: np.ndarray) -> float:
    """The median relative error of the coefficients."""
    p = len(case.names)
    theta = case.centre + np.abs(case.centre) * z[:p]
    return float(np.median(np.abs(theta / case.truth - 1.0)))
