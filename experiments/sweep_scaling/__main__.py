"""`python -m experiments.sweep_scaling --out DIR [--quick]`: one sweep on one device, two, a cluster and in C.

Each engine does sweeps of growing size in a process of its own, once it has compiled: searches a second, and the slope
of the logarithm of time over that of size. `agreement` compares the three stores of the largest sweep, and one of other
chunks, number by number. `memory` asks XLA what a batch of searches takes, against their number and the samples, beside
what the sweep bounds it by. On one CPU device searches go to all cores by threads; two devices share the same cores,
and so do two workers: on two cores the three differ by their overheads alone. `compiled` is one device and C.
"""

import dataclasses
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import distributed
import jax
import jax.numpy as jnp
import numpy as np

from experiments.parts import main
from jaxsub.estimate import gauss_newton, method
from jaxsub.estimate.method import share_for
from jaxsub.sweeps import open_sweep, sweep

from .case import longer, plan
from .figure import draw

ENGINES = ("one_device", "two_devices", "two_workers", "compiled")
_PARTS = (*ENGINES, "agreement", "memory", "figure")
# searches in the chunks of a sweep that is split in another way
_OTHER = 48
_TWO = "--xla_force_host_platform_device_count=2"
_NUMBERS = ("initial_guess", "estimate", "standard_error", "cost", "coordinates")


def sizes(quick: bool) -> list[int]:
    """Searches in each sweep, all of them cut into shares of one size: other shares are other programs."""
    return [128, 256, 512] if quick else [128, 256, 512, 1024]


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results."""
    if name == "two_devices" and os.environ.get("XLA_FLAGS") != _TWO:
        # XLA reads its flags once, before this is reached: begin again with them
        command = [sys.executable, "-m", "experiments.sweep_scaling", *sys.argv[1:]]
        os.execve(sys.executable, command, os.environ | {"XLA_FLAGS": _TWO})
    if name == "two_workers":
        settings = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
        started: Any = distributed.LocalCluster(processes=True, **settings)
        with started as cluster:
            return timed(out / "stores" / name, quick, cluster.scheduler_address)
    if name in ENGINES:
        return timed(out / "stores" / name, quick, None, compiled=name == "compiled")
    return {"agreement": agreement, "memory": memory, "figure": draw}[name](out, quick)


def timed(stores: Path, quick: bool, address: str | None, *, compiled: bool = False) -> dict:
    """Seconds of sweeps of each size, compilation apart, whose stores are kept."""
    clock: Callable[[], float] = time.perf_counter
    planned = lambda count: dataclasses.replace(plan(quick, count), compiled=compiled)
    with tempfile.TemporaryDirectory() as scratch:
        begin = clock()
        # two shares, so that both devices or workers compile
        sweep(planned(2 * share_for(planned(1).problems[0])), Path(scratch), cluster=address)
        first = clock() - begin
    seconds = []
    for size in sizes(quick):
        made, begin = planned(size), clock()
        sweep(made, stores / str(size), cluster=address)
        seconds.append(clock() - begin)
    return {
        "devices": jax.local_device_count(),
        "cores": os.cpu_count(),
        "first_seconds": first,
        "searches": sizes(quick),
        "seconds": seconds,
        "searches_a_second": [size / taken for size, taken in zip(sizes(quick), seconds, strict=True)],
        "slope": slope(sizes(quick), seconds),
    }


def slope(x: list[int], y: list[float]) -> float:
    """Of ln y over ln x."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def agreement(out: Path, quick: bool) -> dict:
    """The largest relative difference between engines, and the share of searches alike to the last digit."""
    size, stores = sizes(quick)[-1], out / "stores"
    other = stores / "other_chunks" / str(size)
    sweep(dataclasses.replace(plan(quick, size), width=[_OTHER]), other)
    base, gaps = open_sweep(stores / ENGINES[0] / str(size)), {}
    for name in (*ENGINES[1:], "other_chunks"):
        found = open_sweep(stores / name / str(size))
        gaps[name] = {number: _difference(base[number].values, found[number].values) for number in _NUMBERS}
        gaps[name]["to_the_last_digit"] = float(np.mean(base.cost.values == found.cost.values))
        gaps[name]["cost_to_a_millionth"] = float(np.mean(np.isclose(base.cost, found.cost, rtol=1e-6, atol=0.0)))
        gaps[name]["outcomes_differ"] = int(np.sum(base.outcome.values != found.outcome.values))
    return {"searches": size, "successful": float(np.mean(base.outcome.values == 0)), "against_one_device": gaps}


def _difference(one: np.ndarray, other: np.ndarray) -> float | None:
    """Largest, relative to the larger of the two; None where one is a number and the other is not."""
    if not np.array_equal(np.isfinite(one), np.isfinite(other)):
        return None
    alike = np.where(one == other, 0.0, np.abs(one - other) / np.maximum(np.abs(one), np.abs(other)))
    return float(np.nanmax(alike, initial=0.0))


def memory(out: Path, quick: bool) -> dict:
    """Bytes that XLA sets aside for a pool of 1, 2, 4, 8 lanes, and of 8 lanes for longer runs, beside the bound."""
    made, lengths = plan(quick, 64), [80, 160, 320] if quick else [300, 600, 1200, 2400]
    lanes = [1, 2, 4, 8]
    by_lanes = [_bytes(made.problems[0], count) for count in lanes]
    problems = [longer(made, length).problems[0] for length in lengths]
    by_samples = [_bytes(problem, 8) for problem in problems]
    return {
        "lanes": lanes,
        "bytes_by_lanes": by_lanes,
        "slope_by_lanes": slope(lanes, by_lanes),
        "samples": lengths,
        "bytes_by_samples": by_samples,
        "slope_by_samples": slope(lengths, by_samples),
        "bound_by_samples": [8 * method.bytes_of_a_lane(problem) for problem in problems],
    }


def _bytes(problem, lanes: int) -> float:
    """What one program with so many lanes takes beside its arguments."""
    starts = jnp.tile(problem.coordinates(), (lanes, 1))
    compiled = method.pooled.lower(gauss_newton(), problem, starts, None).compile()
    return float(compiled.compiled.memory_analysis().temp_size_in_bytes)


if __name__ == "__main__":
    main("experiments.sweep_scaling", __doc__, _PARTS, part)
