"""A plan in words and digests: what distinguishes sweeps, and what a store needs to be read without it."""

import hashlib
import json
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from ..recording import Recording
from ..vehicle import vehicle_text
from ..workers import versions
from .plan import Plan

SCHEMA = 1


def described(plan: Plan) -> dict[str, Any]:
    """All that the answers of `plan` depend on, as JSON has it; two plans are one where these are equal."""
    return {
        "schema": SCHEMA,
        "starts": plan.starts,
        "spread": plan.spread,
        "noise": list(plan.noise),
        "seed": plan.seed,
        "method": plan.method,
        "vehicles": {name: vehicle_text(vehicle) for name, vehicle in plan.vehicles.items()},
        "recordings": {name: {r.name: digest(r) for r in recorded} for name, recorded in plan.recordings.items()},
        "precision": str(np.dtype(jax.numpy.result_type(float))),
        "versions": versions(),
    }


def digest(recording: Recording) -> str:
    """SHA-256 of the samples and their columns' names, wherever the file lies."""
    hashed = hashlib.sha256(recording.times.tobytes())
    for name in sorted(recording.columns):
        hashed.update(name.encode())
        hashed.update(recording.columns[name].tobytes())
    return hashed.hexdigest()


def name_of(description: dict[str, Any]) -> str:
    """SHA-256 of a description: what a chunk's file says it is a part of."""
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()


def difference(kept: dict[str, Any], wanted: dict[str, Any]) -> str | None:
    """The first thing in which two descriptions differ, in words; None where they are one."""
    there, here = dict(_leaves(kept)), dict(_leaves(wanted))
    for key in dict.fromkeys([*here, *there]):
        if there.get(key) == here.get(key):
            continue
        what = " ".join(key)
        if key not in there or key not in here:
            return f"{what} is {'there' if key in there else 'here'} alone"
        if key[0] in ("vehicles", "recordings"):
            return f"{what} has other contents"
        return f"{what} is {there[key]} there and {here[key]} here"
    return None


def _leaves(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    if not isinstance(value, dict):
        yield path, value
        return
    for key, below in value.items():
        yield from _leaves(below, (*path, key))


def layout(plan: Plan) -> dict[str, Any]:
    """What a store is laid out by: names, units and sizes; `plan` is `settled`."""
    rows = {row.name: row.unit for problem in plan.problems for row in problem.vehicle.layout.free}
    values = {name: vehicle.values() for name, vehicle in plan.vehicles.items()}
    return {
        "coefficients": rows,
        "free": [[row.name for row in problem.vehicle.layout.free] for problem in plan.problems],
        "file_values": {name: {c: float(held[c]) for c in rows if c in held} for name, held in values.items()},
        "coordinates": [len(problem.coordinates()) for problem in plan.problems],
        "sigma": [list(sigma) for sigma in plan.sigma or ()],
        "width": list(plan.width or [plan.chunk_width(problem) for problem in plan.problems]),
    }
