"""ANSFL: units strapped to a quadrotor in flight, GPS once a second, no magnetometer; its autopilot and RTK judge.

GPS is the RTK track with noise. No sensor shows the heading, and every record begins in a manoeuvre.
"""

from pathlib import Path

import numpy as np

from jaxsub.recording import Recording

from ..fuzzy_filter.ansfl import (
    BIAS,
    OUTAGE,
    SETTLED,
    Record,
    attitude_errors,
    fixes,
    interpolated,
    outage_times,
    records,
    rms,
)
from ..fuzzy_filter.ansfl import run as library
from .command import Written, columns, navigated

SENSORS = """
schema = 1
name = "ANSFL"
[sensors.gyro]
column = ["gx", "gy", "gz"]
density = 5e-3                       # rad/s/√Hz, 0.3 °: the rotors' vibration
bias = 0.035
wander = 1e-4
[sensors.accelerometer]
column = ["ax", "ay", "az"]
density = 0.3                        # m/s²/√Hz
bias = 0.7
wander = 1e-3
[sensors.gps]
column = ["north", "east", "down"]
channel = ["x", "y", "z"]
sigma = [0.5, 0.5, 1.0]
"""
_WITHOUT_FIXES = ("fused", "last_two_fixes")


def _navigated(record: Record, out: Path, silence: float | None = None) -> Written:
    """The record through the command; with a `silence` it ends ten seconds after that time, without fixes since."""
    at, measured = fixes(record, 1.0)
    track = np.full((len(record.times), 3), np.nan)
    track[at] = measured
    end, name = np.inf, f"path{record.path:02d}_unit{record.unit}"
    if silence is not None:
        track[record.times > silence] = np.nan
        end, name = silence + OUTAGE + 0.1, f"{name}_silent{silence:.0f}"
    parts = columns("g", record.gyro) | columns("a", record.accelerometer)
    parts |= dict(zip(("north", "east", "down"), track.T, strict=True))
    # of a few rows the source repeats the time
    kept = np.concatenate([[True], np.diff(record.times) > 0.0]) & (record.times <= end)
    log = Recording(name, record.times[kept], {key: part[kept] for key, part in parts.items()}, name)
    return navigated(log, SENSORS, out)


def _apart(record: Record, run: Recording, times: np.ndarray) -> np.ndarray:
    """(k, 3) m, the position of a recording less the reference's."""
    position = np.stack([run.column(name) for name in "xyz"], axis=1)
    found = interpolated(times, run.times, position)
    return found - interpolated(times, record.reference_times, record.position)


def _scored(record: Record, out: Path) -> dict:
    """Attitude (°) and position (m) after ten seconds, by filter and smoother; first units also without fixes."""
    written = _navigated(record, out)
    told = record.reference_times[record.reference_times >= SETTLED]
    told = told[told <= written.filtered.times[-1]]
    scores: dict = {}
    for of, run in (("filter", written.filtered), ("smoother", written.smoothed)):
        angles = np.stack([run.column(one) for one in ("phi", "theta", "psi")], axis=1)
        scores[of] = attitude_errors(record, angles, run.times) | {"position_m": rms(_apart(record, run, told))}
    # the library's outages are judged ten times a second too
    if record.unit == 1:
        begin = float(outage_times(record)[-1])
        times = begin + 0.1 * np.arange(1, round(10.0 * OUTAGE) + 1)
        outage = _apart(record, _navigated(record, out, begin).filtered, times)
        scores["outage_m"] = {"rms": rms(outage), "final": float(np.linalg.norm(outage[-1]))}
    low, high = BIAS[record.unit]
    found = written.content["constants"]["gyro_bias_x"]
    bias = {"found": float(np.degrees(found["value"])), "std": float(np.degrees(found["standard_error"]))}
    return scores | {"gyro_bias_x_deg_s": bias | {"told": [low, high]}, "seconds": written.seconds}


def run(out: Path, quick: bool) -> dict:
    """All records, and their means beside those of the library; `quick` takes two records."""
    found = {
        f"path {record.path}, unit {record.unit}": _scored(record, out / "ansfl")
        for record in records()[: 2 if quick else None]
    }
    each = list(found.values())
    mean: dict = {
        of: {key: float(np.mean([scores[of][key] for scores in each])) for key in each[0][of]}
        for of in ("filter", "smoother")
    }
    root = lambda values: float(np.sqrt(np.mean(np.square(values))))
    for of in ("filter", "smoother"):
        mean[of]["position_m"] = root([scores[of]["position_m"] for scores in each])
    known = library(out, True)
    of_library = known["filters"]["constant, gps"]
    mean["library"] = of_library["summary"]["attitude_deg"]
    mean["library"] |= {"position_m": of_library["summary"]["position_rms_m"]["fused"]}
    # the units fly together
    firsts = [name for name, scores in found.items() if "outage_m" in scores]
    lasts = {by: [of_library["records"][name]["outages_m"][-1][by] for name in firsts] for by in _WITHOUT_FIXES}
    for of, outages in (("filter", [found[name]["outage_m"] for name in firsts]), ("library", lasts["fused"])):
        mean[of] |= {f"outage_{key}_m": root([outage[key] for outage in outages]) for key in ("rms", "final")}
    return {
        "records": found,
        "mean": mean,
        "last_two_fixes_outage_m": {
            key: root([last[key] for last in lasts["last_two_fixes"]]) for key in ("rms", "final")
        },
        "units_own_filter_deg": known["units_own_filter_deg"]["mean"],
    }
