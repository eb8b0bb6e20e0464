"""The same programs on the device that JAX picks, for machines with a GPU: seconds a member, by how many there are.

No peer beside it and no C: what there is to compare with are `batched` and `many_starts`. On a CPU, where those measure
more, it takes the small sizes of `--quick`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.cli import terminal
from jaxsub.estimate import Problem
from jaxsub.estimate.method import lanes_for

from .case import problem_and_case
from .ours import COUNT, cost, ended, expansion, points, starts_of, swept, with_gradient
from .timing import a_member, slope, timed

# members of a batch, and of each how many at most: a gradient keeps all steps, an expansion 55 columns
_MEMBERS, _QUICK = (16, 256, 4096, 32768), (4, 16)
_MOST: dict[Callable[[Problem, jax.Array], Any], int] = {cost: 32768, with_gradient: 4096, expansion: 256}


def run(out: Path, quick: bool) -> dict:
    """Seconds a member of batches, how far numbers are from the host's CPU, and a sweep of starts."""
    problem, case = problem_and_case()
    device = jax.local_devices()[0]
    members, starts = (_QUICK, 4) if quick or device.platform == "cpu" else (_MEMBERS, COUNT)
    found: dict = {"device": f"{device.platform}: {device.device_kind}", "seconds_a_member": {}}
    for of, most in _MOST.items():
        rows = {}
        for count in (count for count in members if count <= most):
            z = jnp.asarray(points(case, count))
            row = timed(lambda of=of, z=z: of(problem, z), 3)
            rows[count] = {"first_s": row["first_s"], **a_member(row, count)}
            terminal.note(f"accelerator: {of.__name__} {count}: {rows[count]['s']:.2e} s")
        found["seconds_a_member"][of.__name__] = rows
        whole = [count * row["s"] for count, row in rows.items()]
        found[f"slope_of_time: {of.__name__}"] = slope(list(rows), whole)
    found["agreement"] = _agreement(problem, jnp.asarray(points(case, members[0])))
    row = swept(problem, starts_of(problem, starts))
    return found | {"sweep": {"lanes": lanes_for(problem)} | ended(row, np.nanmin(row["cost"]))}


def _agreement(problem: Problem, z: jax.Array) -> dict[str, float]:
    """The largest relative difference from the same programs on the CPU beside the device."""
    cpu = jax.devices("cpu")[0]
    here, there = (with_gradient(*jax.device_put((problem, z), device)) for device in (jax.local_devices()[0], cpu))
    pairs = zip(("cost", "gradient"), jax.device_get(here), jax.device_get(there), strict=True)
    return {name: float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for name, a, b in pairs}
