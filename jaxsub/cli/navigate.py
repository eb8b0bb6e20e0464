"""`jaxsub navigate`: attitude, velocity and position with standard deviations from raw sensors."""

import math
from pathlib import Path
from typing import Any

from ..navigation.navigate import Navigation, navigate
from ..navigation.recorded import recording_of, reference_errors, summary
from ..navigation.suite import read_sensors
from ..navigation.suite.log import load_sensors
from ..plain import to_json
from ..recording import load, save
from ..report import write_navigation_report
from . import session, terminal
from .effort import TimeLeft
from .output import fresh_folder, paths_of

_STEPS = "filtering and smoothing"
_TAKEN = {True: "taken off", False: "left"}


def run(log_path: Path, sensors_path: Path, out: Path, overwrite: bool, reference: Path | None = None) -> None:
    """Write `navigation.parquet`, `filtered.parquet`, `navigation.json` and a report into `out`."""
    session.start()
    with fresh_folder(out, overwrite, paths_of(log_path, sensors_path, reference)) as folder:
        suite = read_sensors(sensors_path)
        log = load_sensors(log_path, suite)
        truth = None if reference is None else load(reference)
        terminal.warn(log.findings)
        with terminal.progress(f"navigating by {suite.name}") as progress:
            progress(_STEPS)
            found = navigate(log, suite, TimeLeft(progress, _STEPS))
        terminal.warn(found.rows.findings)
        content = summary(found) | {"errors": {} if truth is None else reference_errors(found, truth)}
        terminal.emit(content, lambda: _show(content))
        with terminal.progress("writing") as progress:
            progress("recordings")
            _write(found, content, folder)
            progress("the report")
            write_navigation_report(found, content, folder)


def _write(found: Navigation, content: dict[str, Any], folder: Path) -> None:
    save(recording_of(found, found.smoothed), folder / "navigation.parquet")
    save(recording_of(found, found.filtered), folder / "filtered.parquet")
    (folder / "navigation.json").write_text(to_json(content), encoding="utf-8")


def _show(content: dict[str, Any]) -> None:
    terminal.table(
        ("channel", "σ, median", "σ, largest", "unit"),
        [(name, *_shown(row["unit"], row["median"], row["largest"])) for name, row in content["sigma"].items()],
    )
    terminal.table(
        ("sensor", "measurements", "rejected", "NIS (95 % band)", "correlation (bound)", "verdict"),
        [_sensor_row(row) for row in content["sensors"]],
    )
    terminal.table(
        ("constant", "value", "± 1 σ", "unit"),
        [(n, f"{r['value']:.3g}", f"{r['standard_error']:.2g}", r["unit"]) for n, r in content["constants"].items()],
    )
    if content["errors"]:
        rows = [(n, *_shown(row["unit"], row["rms"]), f"{row['ratio']:.2f}") for n, row in content["errors"].items()]
        terminal.table(("channel", "rms error", "unit", "rms of error/σ"), rows)
    if field := content["magnetometer"]:
        terminal.say(_field_line(field))
    for sentence in content["unobserved"]:
        terminal.say(sentence)


def _field_line(field: dict[str, Any]) -> str:
    """Delay and calibration of the magnetometer in a sentence."""
    delay = f"{1e3 * field['delay']:.3g} ± {1e3 * field['delay_std']:.2g} ms ({_TAKEN[field['delayed']]})"
    spread = f"{100.0 * field['before']:.2g} % as read and {100.0 * field['after']:.2g} % calibrated"
    taken = "left as read" if field["corrected"] == "none" else f"calibration: {field['corrected']}"
    return f"magnetometer: delay {delay}; the field's strength differs by {spread} ({taken})"


def _shown(unit: str, *values: float) -> tuple[str, ...]:
    turn = math.degrees(1.0) if unit == "rad" else 1.0
    return (*(f"{turn * value:.3g}" for value in values), "°" if unit == "rad" else unit)


def _sensor_row(row: dict[str, Any]) -> tuple[str, ...]:
    nis = f"{row['nis']:.2f} ({row['low']:.2f} to {row['high']:.2f})"
    correlation = f"{row['correlation']:.2f} (±{row['bound']:.2f})"
    return row["name"], str(row["measurements"]), str(row["rejected"]), nis, correlation, row["verdict"]
