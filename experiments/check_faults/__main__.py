"""`python -m experiments.check_faults --out DIR [--quick]`: what `jaxsub check` finds, and how often it is wrong.

Writes `results.json` and `detection.png`: for each kind of fault the share of runs in which it is named, by its size,
beside the share of clean runs in which anything is named. Seeds are other than those that thresholds were set on.
"""

import argparse
import collections
import json
from pathlib import Path
from typing import Any

import numpy as np

from jaxsub.checks import check
from jaxsub.cli import session, terminal
from jaxsub.findings import Finding

from .faults import FAULTS
from .figure import draw
from .runs import SENSORS, VEHICLES, clean_runs

# of the vehicle and of inputs, which are as they are in these runs
_TRUE = ("unstable", "sampling", "input-at-rest")
_FIRST = 1000  # seeds


def alarms(findings: tuple[Finding, ...]) -> list[Finding]:
    """The warnings and errors about the samples of a run."""
    return [finding for finding in findings if finding.severity != "note" and finding.check not in _TRUE]


def clean(count: int) -> dict[str, Any]:
    """Clean runs with an alarm, by vehicle and sensors, `count` of each."""
    cells, said = [], []
    for vehicle_name in VEHICLES:
        for sensors in SENSORS:
            vehicle, runs = clean_runs(vehicle_name, sensors, range(_FIRST, _FIRST + count))
            found = [alarms(check(vehicle, [run]).findings) for run in runs]
            cells.append({"vehicle": vehicle_name, "sensors": sensors, "runs": count, "alarms": sum(map(bool, found))})
            said += [finding.line() for findings in found for finding in findings]
            terminal.note(f"{vehicle_name}, {sensors}: {cells[-1]['alarms']} of {count}")
    total, wrong = sum(cell["runs"] for cell in cells), sum(cell["alarms"] for cell in cells)
    return {"runs": total, "alarms": wrong, "rate": wrong / total, "cells": cells, "findings": said}


def detection(count: int) -> dict[str, Any]:
    """For each fault the share of `count` runs in which it is named, and in which something else is, by its size."""
    vehicle, runs = clean_runs("surface vessel", "white", range(2 * _FIRST, 2 * _FIRST + count))
    found = {}
    for name, fault in FAULTS.items():
        named, other = [], []
        for size in fault.sizes:
            faulty = [fault.put(run, size, np.random.default_rng([i, 3])) for i, run in enumerate(runs)]
            findings = [tuple(alarms(check(vehicle, [run]).findings)) for run in faulty]
            named.append(sum(fault.named(each) for each in findings) / count)
            other.append(sum(bool(each) and not fault.named(each) for each in findings) / count)
        found[name] = {"unit": fault.unit, "sizes": list(fault.sizes), "named": named, "called_something_else": other}
        terminal.note(f"{name}: {dict(zip(fault.sizes, named, strict=True))}")
    return found


def main() -> None:
    """Measure both and draw them."""
    parser = argparse.ArgumentParser(prog="python -m experiments.check_faults", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="few seeds")
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    session.start(long=True)
    results = {"clean": clean(2 if chosen.quick else 15), "detection": detection(3 if chosen.quick else 20)}
    checks = collections.Counter(line.split(": ")[1] for line in results["clean"]["findings"])
    terminal.note(f"clean runs with an alarm: {results['clean']['alarms']} of {results['clean']['runs']}, {checks}")
    (chosen.out / "results.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    (chosen.out / "detection.png").write_bytes(draw(results))
    terminal.say(f"results: {chosen.out / 'results.json'}")


if __name__ == "__main__":
    main()
