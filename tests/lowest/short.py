"""A short run of the whole package, for an environment with the lowest versions that pyproject.toml allows.

Imports every module and identifies a vehicle from a recording of itself; `--diagnose` diagnoses it too.
"""

import importlib
import pkgutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import jaxsub
from jaxsub.recording import Recording, save
from jaxsub.simulate.synthetic import synthetic
from jaxsub.vehicle import vehicle_text
from jaxsub.vehicle.catalogue import dsrv

BEGIN = "import sys; from jaxsub.cli import main; sys.argv[0] = 'jaxsub'; main()"


def main() -> None:
    for module in pkgutil.walk_packages(jaxsub.__path__, "jaxsub."):
        importlib.import_module(module.name)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "vehicle.toml").write_text(vehicle_text(dsrv()), encoding="utf-8")
        t = 0.25 * np.arange(200)
        driven = Recording("run", t, {"delta_s": 0.2 * np.sign(np.sin(0.5 * t))}, "made")
        (recording,) = synthetic(dsrv(), [driven], seed=0)
        save(recording, folder / "run.csv")
        for command in ["identify", *(["diagnose"] if "--diagnose" in sys.argv else [])]:
            files = [command, str(folder / "vehicle.toml"), str(folder / "run.csv"), "--out", str(folder / command)]
            subprocess.run([sys.executable, "-c", BEGIN, *files], check=True)


if __name__ == "__main__":
    main()
