"""`python -m experiments.autopilot --out DIR [--flights N] [--quick]`: REMUS 100, which autopilots steer, diagnosed.

All that is not linear is missing from its file, and the vehicle does not run free for long.

Every flight is files of its own, and the judge sees only them. `results.json`: names that are there and are not, their
numbers beside the publication's, and the errors on test runs before and after.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from jaxsub.cli import session, terminal
from jaxsub.discrepancy import diagnose
from jaxsub.recording import Recording, load, save
from jaxsub.vehicle import read_vehicle, write_vehicle
from jaxsub.vehicle.catalogue import remus_100

from .figure import draw
from .flight import ALIKE, INPUTS, INTERVAL, MISSING, STATES, fly

_RUNS, _SAMPLES = 4, 800


def main() -> None:
    """Fly, diagnose, and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--flights", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="one flight")
    chosen = parser.parse_args()
    session.start()
    lines = []
    for number in range(1 if chosen.quick else chosen.flights):
        folder = chosen.out / f"flight{number + 1}"
        write(folder, number)
        lines.append(judged(folder))
        terminal.note(said(lines[-1]))
        (chosen.out / "results.json").write_text(json.dumps(lines, indent=1), encoding="utf-8")
    draw(lines, chosen.out / "autopilot.png")


def write(folder: Path, number: int) -> None:
    """`vehicle.toml` as in the catalogue, linear, and recordings of a flight that is not."""
    folder.mkdir(parents=True, exist_ok=True)
    vehicle, rng = remus_100(), np.random.default_rng([31, number])
    write_vehicle(vehicle, folder / "vehicle.toml")
    for run in range(_RUNS):
        states, fins = fly(_SAMPLES, rng)
        columns = dict(zip(STATES, states.T, strict=True))
        shown = {o.channel: columns[o.channel] + (o.sigma or 0.0) * rng.standard_normal(_SAMPLES)
                 for o in vehicle.layout.outputs}  # fmt: skip
        shown |= dict(zip(INPUTS, fins.T, strict=True))
        save(Recording(f"run{run + 1}", INTERVAL * np.arange(_SAMPLES), shown, "flight"), folder / f"run{run + 1}.csv")


def judged(folder: Path) -> dict:
    """What a diagnosis says of the files, the last run as test run, beside what is true."""
    runs = [load(path) for path in sorted(folder.glob("run*.csv"))]
    begin = time.perf_counter()
    note = lambda message: terminal.note(message)
    found, _ = diagnose(read_vehicle(folder / "vehicle.toml"), runs[:-1], runs[-1:], progress=note)
    seconds = time.perf_counter() - begin
    numbers = {}
    for one in found.physics:
        first, *_ = one.parameters.values()
        numbers[one.label] = {
            "value": first.value,
            "standard_error": first.standard_error,
            "published": MISSING.get(one.label),
            "probability": one.probability,
        }
    return {
        "verdict": found.verdict,
        "there": [label for label in numbers if label in MISSING],
        "alike": [label for label in numbers if label in ALIKE],
        "not_there": [label for label in numbers if label not in MISSING and label not in ALIKE],
        "missed": [label for label in MISSING if label not in numbers],
        "numbers": numbers,
        "held_out": found.fit["held_out"],
        "notes": found.notes,
        "seconds": seconds,
    }


def said(line: dict) -> str:
    """A line for the terminal."""
    counts = f"{len(line['there'])} there, {len(line['alike'])} alike, {len(line['not_there'])} not there"
    return f"{line['verdict']}: {counts} {line['not_there']}, {len(line['missed'])} missed, {line['seconds']:.0f} s"


if __name__ == "__main__":
    main()
