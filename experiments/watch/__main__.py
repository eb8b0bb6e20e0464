"""`python -m experiments.watch --out DIR [--quick]`: false alarms, delays, places and speed of `jaxsub watch`.

Truths have equations of their own (`truth.py`); the watcher is calibrated on four clean hours. `results.json`: false
alarms of 100 clean hours beside the stated rate, with and without disturbance forces; delay and place of seven faults,
beside a fixed threshold of innovations and the fuzzy rule, both set to the largest value of the same clean hours;
milliseconds a sample, and memory.
"""

import argparse
import json
import resource
import time
from pathlib import Path
from typing import Any

import numpy as np

from jaxsub.cli import session, terminal
from jaxsub.monitoring import Watcher
from jaxsub.monitoring.calibration import peaks

from .detectors import PLACES, Series, by_fuzzy_rule, by_innovations, watched
from .truth import DT, FAULTS, ONSET, Runs, simulate, vehicle

RATES, RATE = (1.0, 0.1), 0.01
# where each fault may rightly be said to be
_RIGHT = {
    FAULTS[0]: {"surge"},
    FAULTS[1]: {"sway", "yaw"},
    FAULTS[2]: {"surge", "sway", "yaw"},
    FAULTS[3]: {"surge"},
    FAULTS[4]: {"sensor:psi"},
    FAULTS[5]: {"sensor:u"},
    FAULTS[6]: {"sensor:r"},
}
_HOUR, _QUIET = 3600.0, 60.0
# clean hours whose largest values are the limits of the other detectors
_COMPARED = 40


def main() -> None:
    """Measure, and write `results.json`."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="a tenth of the hours")
    chosen = parser.parse_args()
    chosen.out.mkdir(parents=True, exist_ok=True)
    session.choose_device()
    session.start(long=True)
    hours, each = (10, 2) if chosen.quick else (100, 8)
    found: dict[str, Any] = {"hours": hours, "runs": each}
    found["false_alarms"] = {}
    for name, coloured in (("white", False), ("coloured", True)):
        terminal.note(f"{name}: {hours} clean hours")
        watcher = calibrated(coloured)
        clean = simulate([None] * hours, _HOUR, 1 + coloured, coloured)
        series = watched(watcher, clean)
        found["false_alarms"][name] = [false_alarms(watcher, series, rate) for rate in RATES]
        write(found, chosen.out)
    compared = Runs(clean.rows[:_COMPARED])
    _, limits = by_innovations(compared)
    fuzzy, usual = by_fuzzy_rule(compared)
    highest = float(fuzzy.statistic[:, round(60.0 / DT) :].max())
    faulty = simulate([f for f in FAULTS for _ in range(each)], ONSET + 1.05 * _HOUR, 7, True)
    detectors = {
        "watch": (lambda: watched(watcher, faulty), watcher.threshold),
        "fixed threshold": (lambda: by_innovations(faulty, limits)[0], 1.0),
        "fuzzy rule": (lambda: by_fuzzy_rule(faulty, usual)[0], highest),
    }
    found["detection"] = {}
    for name, (detect, limit) in detectors.items():
        series = detect()
        found["detection"][name] = [detected(series, limit, i, each) for i in range(len(FAULTS))]
        write(found, chosen.out)
    found["speed"] = timed(watcher, 20_000 if chosen.quick else 200_000)
    write(found, chosen.out)


def write(found: dict[str, Any], folder: Path) -> None:
    """What was found so far."""
    (folder / "results.json").write_text(json.dumps(found, indent=1), encoding="utf-8")


def calibrated(coloured: bool) -> Watcher:
    """A watcher by four clean hours."""
    clean = simulate([None] * 4, _HOUR, 11 + coloured, coloured)
    return Watcher.of(vehicle(), clean.rows[0, :16], clean.recordings(), false_alarms_per_hour=RATE)


def false_alarms(watcher: Watcher, series: Series, rate: float) -> dict:
    """How many there are at the threshold of a rate, beside how many there should be."""
    part = round(10.0 / DT)
    whole = series.statistic[:, : series.statistic.shape[1] // part * part]
    largest = whole.reshape(len(whole), -1, part).max(axis=2)
    hours = largest.size * 10.0 / _HOUR
    count = len(peaks(largest, watcher.tail.threshold(rate), round(_QUIET / 10.0)))
    return {"stated_per_hour": rate, "expected": rate * hours, "counted": count, "ratio": count / (rate * hours)}


def detected(series: Series, limit: float, fault: int, each: int) -> dict:
    """Delays and places of the first alarm after the onset, of the runs of a fault."""
    delays, places, among, early = [], [], [], 0
    onset = round(ONSET / DT)
    for run in range(fault * each, (fault + 1) * each):
        early += bool(np.any(series.statistic[run, 300:onset] > limit))
        late = np.flatnonzero(series.statistic[run, onset:] > limit)
        if late.size:
            delays.append(float(late[0] * DT))
            at = run, onset + late[0]
            places.append(PLACES[int(series.place[at])])
            named = np.arange(len(PLACES)) == series.place[at] if series.likely is None else series.likely[at]
            among.append({PLACES[i] for i in np.flatnonzero(named)})
    right = sum(place in _RIGHT[FAULTS[fault]] for place in places)
    among_right = sum(bool(own & _RIGHT[FAULTS[fault]]) for own in among)
    return {
        "fault": FAULTS[fault],
        "runs": each,
        "detected": len(delays),
        "alarms_before": early,
        "delay_median": float(np.median(delays)) if delays else None,
        "delay_largest": max(delays, default=None),
        "right_place": right,
        "right_among": among_right,
        "places_named": float(np.mean([len(own) for own in among])) if among else None,
        "places": {place: places.count(place) for place in sorted(set(places))},
    }


def timed(watcher: Watcher, samples: int) -> dict:
    """Milliseconds a sample, and how much memory grows over the last nine tenths of them."""
    rows = simulate([None], _HOUR, 5, True).rows[0]
    length, spent = len(rows), np.empty(samples)
    early = 0
    for k in range(samples):
        row = rows[k % length].copy()
        row[0] = DT * k
        begin = time.perf_counter()
        watcher.step(row)
        spent[k] = time.perf_counter() - begin
        if k == samples // 10:
            early = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - early
    return {
        "samples": samples,
        "median_ms": 1e3 * float(np.median(spent)),
        "share_over_2_ms": float(np.mean(spent > 2e-3)),
        "memory_growth_kB": int(grown),
    }


if __name__ == "__main__":
    main()
