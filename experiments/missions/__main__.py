"""`python -m experiments.missions --out DIR [--quick] [--dives N …]`.

A glider's mission of each number of dives is written to files and given to `jaxsub diagnose` in a process of its own.
`results.json` has the seconds, the peak memory and what was named of each.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from jaxsub.fingerprint import sources
from jaxsub.programs import cores

from .dives import CONCEALED, write_mission

SAMPLES = 1000


def main() -> None:
    """Diagnose every mission, the smallest first, and keep what is done so far."""
    parser = argparse.ArgumentParser(prog="python -m experiments.missions", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="four dives alone")
    parser.add_argument("--dives", type=int, nargs="+", default=[10, 30, 100, 300])
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    results = {"samples": SAMPLES, "cores": cores(), "missions": []}
    for dives in [4] if chosen.quick else sorted(chosen.dives):
        results["missions"].append(_diagnosed(dives))
        print(json.dumps(results["missions"][-1]))
        (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")


def _diagnosed(dives: int) -> dict:
    """What a process that diagnoses a mission of so many dives took, and what it named."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, out = Path(scratch) / "files", Path(scratch) / "out"
        runs = write_mission(folder, dives, SAMPLES)
        command = [sys.executable, "-m", "jaxsub", "diagnose", folder / "vehicle.toml", *runs, "--out", out]
        before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([*map(str, command)], check=True, capture_output=True)
        seconds, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
        found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    named = [one["effect"] for one in found["physics"]]
    return {
        "engine": sources()[:12],
        "dives": dives,
        "seconds": seconds,
        "cpu_seconds": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
        # of the largest child so far, which is this one, as missions grow
        "peak_GB": after.ru_maxrss / 1e6,
        "verdict": found["verdict"],
        "named": named,
        "right": sorted(named) == sorted(CONCEALED),
        "left": found["left"],
    }


if __name__ == "__main__":
    main()
