"""A short run of the whole package, for an environment with the lowest versions that pyproject.toml allows.

Imports every module, then identifies and diagnoses a vehicle from recordings of itself by the command line. The second
identification reads its programs from the cache that the first has filled: both must find the vehicle's coefficients.
Last, a recording in every format of the extras `files` and `logs` is read, and compared with what was written.
"""

import importlib
import json
import os
import pkgutil
import subprocess
import sys
import tempfile
from pathlib import Path

import jax
import numpy as np

import jaxsub
from jaxsub.recording import Recording, load, save
from jaxsub.simulation.synthesis import synthetic
from jaxsub.vehicle import AbstractVehicle, vehicle_text
from jaxsub.vehicle.catalogue import dsrv

BEGIN = "import sys; from jaxsub.cli import main; sys.argv[0] = 'jaxsub'; main()"
# standard errors that an estimate may be off
FAR = 5.0


def main() -> None:
    for module in pkgutil.walk_packages(jaxsub.__path__, "jaxsub."):
        importlib.import_module(module.name)
    jax.config.update("jax_enable_x64", True)
    with tempfile.TemporaryDirectory() as name:
        folder, vehicle = Path(name), dsrv()
        (folder / "vehicle.toml").write_text(vehicle_text(away(vehicle)), encoding="utf-8")
        t = 0.25 * np.arange(200)
        for seed in (1, 2):
            driven = Recording("run", t, {"delta_s": 0.2 * np.sign(np.sin(0.5 * seed * t))}, "made")
            (recording,) = synthetic(vehicle, [driven], seed=seed)
            save(recording, folder / f"run{seed}.csv")
        for cache in ("empty", "filled"):
            require_true(command(folder, "identify", "run1.csv", "--out", cache), vehicle, cache)
        found = command(folder, "diagnose", "run1.csv", "run2.csv", "--no-manoeuvre", "--out", "diagnosed")
        assert found["verdict"] == "none", found["verdict"]
        require_read(folder)


def away(vehicle: AbstractVehicle) -> AbstractVehicle:
    """The vehicle with every free coefficient 10 % off."""
    values = vehicle.values()
    return vehicle.with_values({row.name: 1.1 * values[row.name] for row in vehicle.layout.free})


def command(folder: Path, name: str, *words: str) -> dict:
    """What `jaxsub name vehicle.toml …` prints as JSON; it must end with 0 and without a warning."""
    environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
    words = (name, "vehicle.toml", *words, "--json", "--strict")
    done = subprocess.run(
        [sys.executable, "-c", BEGIN, *words], cwd=folder, env=environment, stdout=subprocess.PIPE, check=True
    )
    return json.loads(done.stdout)


def require_true(identified: dict, vehicle: AbstractVehicle, cache: str) -> None:
    """Every coefficient is identified and near the vehicle's."""
    for name, found in identified["coefficients"].items():
        error = abs(found["value"] - float(vehicle.values()[name])) / found["standard_error"]
        assert error < FAR, f"{name} is {error:.1f} standard errors off with an {cache} cache"


def require_read(folder: Path) -> None:
    """A file of every format that the tests can write, and a glider's dive that dbdreader comes with, are read."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "recording"))
    import ardupilot_examples
    import dbdreader
    import file_examples
    import log_examples

    for kind, write in file_examples.WRITERS.items():
        write(folder / f"run.{kind}")
        found = load(folder / f"run.{kind}", file_examples.COLUMNS.get(kind))
        name = "r" if kind in file_examples.COLUMNS else "u"
        of_logs = ardupilot_examples.RATE if kind in ("bin", "tlog") else log_examples.YAW_RATE
        written = {"u": file_examples.U, "r": -of_logs if kind == "bag" else of_logs}[name]
        np.testing.assert_allclose(found.column(name), written, atol=1e-6, err_msg=kind)
    dive = Path(dbdreader.__file__).parent / "data" / "ammonite-2008-028-01-000.mbd"
    found = load(dive, {"z": "m_depth", "pressure": "m_pressure"})
    deep = found.column("z") > 20.0
    density = found.column("pressure")[deep] / (9.81 * found.column("z")[deep])
    assert 1000.0 < np.nanmedian(density) < 1050.0, np.nanmedian(density)  # kg/m³, sea water


if __name__ == "__main__":
    main()
