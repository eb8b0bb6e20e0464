"""`python -m experiments.benchmarks --out DIR [--quick] [--part NAME]`: speed, against what a user would pick instead.

Each part runs in a process of its own; `results.json` holds all, with what was aimed at, and `benchmarks.png` shows it.

- `fit`: one fit, beside SciPy, CasADi with IPOPT and jax-sysid. `many_starts`: a sweep, beside CasADi's C.
- `likelihood`, `batched`: a likelihood, its gradient and Jacobian, beside CasADi's, and the floor.
- `throughput`: a filter, beside filterpy and dynamax.
- `score_pass`, `diagnose`: 200 candidates at once, beside refits of each; the command, cold and warm.
- `identify`: the command on two coordinates and 400 samples, cold and again.
- `growth`: time and memory with samples, batch, coefficients and candidates.
- `accelerator`: batches and a sweep on the device that JAX picks, which needs no peers: for machines with a GPU.
"""

import importlib
import os
import platform
from collections.abc import Mapping
from pathlib import Path

import jax

from ..parts import main
from .targets import judged

# the part's module, and what in it is the part
_PARTS = {
    "fit": ("fit", "run"),
    "likelihood": ("likelihood", "single"),
    "batched": ("likelihood", "batched"),
    "many_starts": ("many_starts", "run"),
    "throughput": ("throughput", "run"),
    "score_pass": ("diagnosis", "score_pass"),
    "diagnose": ("diagnosis", "whole"),
    "identify": ("identification", "whole"),
    "growth": ("growth", "run"),
    "accelerator": ("accelerator", "run"),
    "figure": ("figure", "run"),
}


def part(name: str, out: Path, quick: bool) -> dict:
    """One part's results, and how busy the machine was."""
    module, call = _PARTS[name]
    before = os.getloadavg()[0]
    found = getattr(importlib.import_module(f".{module}", __package__), call)(out, quick)
    return found | {"load": [before, os.getloadavg()[0]]}


def assembled(found: Mapping[str, dict]) -> dict:
    """All parts, the machine, and what was aimed at."""
    machine = {"python": platform.python_version(), "jax": jax.__version__, "cores": os.cpu_count()}
    measured = {name: results for name, results in found.items() if name != "figure"}
    return {"machine": machine, "targets": judged(measured), **measured}


if __name__ == "__main__":
    main("experiments.benchmarks", __doc__, tuple(_PARTS), part, assembled)
