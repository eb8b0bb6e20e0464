"""`jaxsub identify` on long runs stays within bounded memory."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.recording import save
from jaxsub.simulation import synthetic
from jaxsub.vehicle import AbstractVehicle, write_vehicle
from jaxsub.vehicle.catalogue import nps_auv_ii

_SCRIPT = """
import sys
sys.argv = ["jaxsub", "identify", *sys.argv[1:]]
from jaxsub.cli import main
main()
# of this program alone: what `getrusage` says begins with the memory of the process that started it
print("peak", next(line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")))
"""


def peak(folder: Path, samples: int, vehicle: AbstractVehicle | None = None, amplitude: float = 1.0) -> float:
    """Peak memory (MB) of `identify` on so many samples, of an oscillator where no other vehicle is given."""
    vehicle = vehicle or oscillator()
    asked = driven(vehicle, 0.1 * np.arange(samples), seed=1, amplitude=amplitude)
    save(synthetic(vehicle, [asked], seed=1)[0], folder / "run.csv")
    write_vehicle(vehicle, folder / "vehicle.toml")
    paths = [str(folder / name) for name in ("vehicle.toml", "run.csv")]
    command = [sys.executable, "-c", _SCRIPT, *paths, "--out", str(folder / f"out-{samples}")]
    environment = os.environ | {"XDG_CACHE_HOME": str(folder)}
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, env=environment, check=True)
    assert "The fit explains these runs" in done.stdout
    return int(done.stdout.split()[-1]) / 1e3


@pytest.mark.long
def test_memory_grows_by_bounded_bytes_a_row(tmp_path):
    """Claim: from 100 000 to 300 000 rows the peak grows by less than 0.5 kB a row, with programs in the cache."""
    peak(tmp_path, 24_000)
    assert (peak(tmp_path, 300_000) - peak(tmp_path, 100_000)) * 1e6 / 200_000 < 500.0


@pytest.mark.long
def test_a_million_rows_are_identified(tmp_path):
    """Claim: 1 000 000 rows end within 600 s and 1.1 GB."""
    assert peak(tmp_path, 1_000_000) < 1100.0


@pytest.mark.long
def test_six_degrees_of_freedom_are_identified_in_bounded_memory(tmp_path):
    """Claim: 24 000 rows, 21 coefficients and 10 channels stay within 1.2 GB, programs compiled anew."""
    assert peak(tmp_path, 24_000, nps_auv_ii(), 0.1) < 1200.0
