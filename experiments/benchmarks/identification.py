"""What `jaxsub identify` takes in a process of its own, with an empty compilation cache and with a full one."""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from jaxsub.recording import Recording, save
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import vehicle_from, write_vehicle

_SAMPLES, _INTERVAL = 400, 0.1
_COMMAND = "from jaxsub.cli import main; main()"


def whole(out: Path, quick: bool) -> dict:
    """Two coordinates, six free coefficients and 400 samples: wall and processor seconds, cold and again."""
    results: dict[str, Any] = {"samples": _SAMPLES}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        _write(folder)
        environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
        for label in ("cold", "again"):
            paths = [str(folder / name) for name in ("vehicle.toml", "run.csv")]
            command = [sys.executable, "-c", _COMMAND, "identify", *paths, "--out", str(folder / label)]
            before, begin = _processor(), time.perf_counter()
            subprocess.run(command, env=environment, check=True, capture_output=True)
            results[label] = {"wall_s": time.perf_counter() - begin, "processor_s": _processor() - before}
        results["peak_memory_GB"] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    return results


def _processor() -> float:
    """Processor seconds of the processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _write(folder: Path) -> None:
    """A vehicle file and a recording that it could have made."""
    fixed = {name: {"value": value, "fixed": True} for name, value in {"I_a": 2.0, "I_b": 1.0}.items()}
    free = {"D_a": 0.5, "D_b": 0.2, "K_a": 3.0, "K_b": 5.0, "K_a_b": -1.0, "B_a_drive": 1.0}
    outputs = {"a": {"sigma": 0.01}, "b": {"sigma": 0.01}, "b_rate": {"sigma": 0.02}}
    data = {"schema": 1, "name": "pair", "kind": "mechanism", "dof": ["a", "b"], "coefficients": fixed | free}
    vehicle = vehicle_from(data | {"inputs": {"drive": "f"}, "outputs": outputs}, "pair.toml")
    columns = {name: np.full(_SAMPLES, np.nan) for name in vehicle.layout.channels}
    asked = Recording("run", _INTERVAL * np.arange(_SAMPLES), columns | {"f": prbs(_SAMPLES, 15, 1.0, 1)}, "run")
    save(synthetic(vehicle, [asked], seed=1)[0], folder / "run.csv")
    write_vehicle(vehicle, folder / "vehicle.toml")
