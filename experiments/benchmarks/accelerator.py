"""The same programs on the device that JAX picks, for machines with a GPU: seconds a member, by how many there are.

No peer beside it and no C: what there is to compare with is this part on a CPU (`JAX_PLATFORMS=cpu`) and `many_starts`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.cli import session
from jaxsub.estimate import Problem, gauss_newton, scattered
from jaxsub.estimate.method import lanes_for

from .case import problem_and_case
from .ours import cost, expansion, points, with_gradient
from .timing import once, slope, timed

# members of a batch, and of each how many at most: a gradient keeps all steps, an expansion 55 columns
_MEMBERS, _QUICK = (16, 256, 4096, 32768), (4, 16)
_MOST: dict[Callable[[Problem, jax.Array], Any], int] = {cost: 32768, with_gradient: 4096, expansion: 256}
COUNT, SPREAD, SEED = 1000, 0.5, 5


def run(out: Path, quick: bool) -> dict:
    """Seconds a member of batches, how far numbers are from the host's CPU, and a sweep of starts."""
    problem, case = problem_and_case()
    device = jax.local_devices()[0]
    members = _QUICK if quick else _MEMBERS
    found: dict = {"device": f"{device.platform}: {device.device_kind}", "seconds_a_member": {}}
    for of, most in _MOST.items():
        rows = {}
        for count in (count for count in members if count <= most):
            z = jnp.asarray(points(case, count))
            row = timed(lambda of=of, z=z: of(problem, z), 3)
            rows[count] = {"first_s": row.pop("first_s"), **{name: s / count for name, s in row.items()}}
            session.console.print(f"accelerator: {of.__name__} {count}: {rows[count]['s']:.2e} s", highlight=False)
        found["seconds_a_member"][of.__name__] = rows
        whole = [count * row["s"] for count, row in rows.items()]
        found[f"slope_of_time: {of.__name__}"] = slope(list(rows), whole)
    found["agreement"] = _agreement(problem, jnp.asarray(points(case, members[0])))
    return found | {"sweep": _sweep(problem, 4 if quick else COUNT)}


def _agreement(problem: Problem, z: jax.Array) -> dict[str, float]:
    """The largest relative difference from the same programs on the CPU beside the device."""
    cpu = jax.devices("cpu")[0]
    here, there = (with_gradient(*jax.device_put((problem, z), device)) for device in (jax.local_devices()[0], cpu))
    pairs = zip(("cost", "gradient"), jax.device_get(here), jax.device_get(there), strict=True)
    return {name: float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for name, a, b in pairs}


def _sweep(problem: Problem, count: int) -> dict:
    """A search from each of so many starts, compiling apart, on starts that end at once."""
    starts = scattered(problem, SPREAD, count, SEED)
    search = lambda chosen: gauss_newton().run(problem, chosen)
    _, compiling = once(lambda: search(jnp.full_like(starts, jnp.nan)))
    found, seconds = once(lambda: search(starts))
    costs = np.asarray(found.cost)
    return {
        "starts": count,
        "lanes": lanes_for(problem),
        "compile_s": compiling,
        "seconds": seconds,
        "seconds_a_start": seconds / count,
        "reached": float(np.mean(costs < np.nanmin(costs) + 0.1)),
        "lost": int(np.sum(~np.isfinite(costs))),
        "evaluations_median": float(np.median(np.asarray(found.evaluations))),
    }
