"""Holes in time, and sensors that start late."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np

from ..findings import Finding, Severity
from ..recording import Recording
from .channels import Channel
from .spans import amount, of_run

_LONG = 5.0  # times the 90th percentile of the time steps: uneven logs stay below
_MOVED = 0.02  # of an input's range
_SHORTEST = 10  # rows of a piece worth keeping
_MOST = 50  # pieces of one run: each has an initial state of its own
_LATE = 5  # rows


def pieces(recording: Recording, signals: Sequence[Channel]) -> tuple[list[Recording], list[Finding]]:
    """The run cut where time has a hole while an input moved, and what was found.

    An input is held and a prescribed motion interpolated over the hole, which they were not. A hole over which every
    signal rests is no harm: it is noted. Pieces below 10 rows are left out.
    """
    gaps = _gaps(recording.times)
    if not gaps:
        return [recording], []
    moved = [gap for gap in gaps if any(_moves(recording, channel.name, gap) for channel in signals)]
    rest = [gap for gap in gaps if gap not in moved]
    median = amount(float(np.median(np.diff(recording.times))), "s")
    findings = []
    if rest:
        what = f"{_longest(recording, rest)} beside a median step of {median}, all inputs at rest"
        findings.append(_at_gaps(recording, rest, "note", what, ""))
    if not moved:
        return [recording], findings
    edges = [0, *(gap + 1 for gap in moved), len(recording.times)]
    spans = [(a, b) for a, b in itertools.pairwise(edges) if b - a >= _SHORTEST]
    said = f"{_longest(recording, moved)} beside a median step of {median} while an input moved"
    if len(spans) > _MOST or not spans:
        why = f"cutting it there leaves {len(spans)} pieces of {_SHORTEST} rows or more"
        remedy = "record without holes, or give the good stretches as runs"
        findings.append(_at_gaps(recording, moved, "error", f"{said}; {why}", remedy))
        return [recording], findings
    lost = len(recording.times) - sum(b - a for a, b in spans)
    left_out = f", {lost} rows in pieces below {_SHORTEST} rows left out" if lost else ""
    what = f"{said}: cut into {len(spans)} {'run' if len(spans) == 1 else 'runs'} there{left_out}"
    findings.append(_at_gaps(recording, moved, "warning", what, "fill the hole in if the log has it elsewhere"))
    index = np.arange(len(recording.times))
    parts = [recording.select((index >= a) & (index < b)) for a, b in spans]
    if len(parts) > 1:
        parts = [dataclasses.replace(part, name=f"{part.name}, part {i}") for i, part in enumerate(parts, 1)]
    return parts, findings


def late_start(recording: Recording, channel: Channel) -> list[Finding]:
    """A note where the first samples of a measured channel are missing: its first value is not the state at t = 0."""
    there = np.flatnonzero(np.isfinite(recording.columns[channel.name]))
    if not there.size or there[0] < _LATE or there[0] < 0.02 * len(recording.times):
        return []
    late = float(recording.times[there[0]] - recording.times[0])
    what = f"starts {amount(late, 's')} after the run: its first value is not the state at the start"
    return [of_run("late-start", "note", recording, channel.name, what, count=int(there[0]))]


def _gaps(times: np.ndarray) -> list[int]:
    """The rows after which time has a hole."""
    steps = np.diff(times)
    usual = max(float(np.median(steps)), float(np.percentile(steps, 90.0)))
    return np.flatnonzero(steps > _LONG * usual).tolist()


def _moves(recording: Recording, name: str, gap: int) -> bool:
    """Whether a signal differs across the hole after row `gap`, or moves as near to it as the hole is long."""
    values, times = recording.columns[name], recording.times
    reach = float(times[gap + 1] - times[gap])
    first = min(int(np.searchsorted(times, times[gap] - reach)), max(gap - 5, 0))
    last = max(int(np.searchsorted(times, times[gap + 1] + reach, side="right")), gap + 7)
    near = values[first:last]
    span = float(np.ptp(values))
    return span > 0.0 and float(np.ptp(near)) > _MOVED * span


def _longest(recording: Recording, gaps: Sequence[int]) -> str:
    longest = max(float(recording.times[gap + 1] - recording.times[gap]) for gap in gaps)
    holes = "a hole in time of" if len(gaps) == 1 else f"{len(gaps)} holes in time of up to"
    return f"{holes} {amount(longest, 's')}"


def _at_gaps(recording: Recording, gaps: Sequence[int], severity: Severity, what: str, remedy: str) -> Finding:
    rows = tuple((recording.first_row + gap, recording.first_row + gap + 1) for gap in gaps)
    times = tuple((float(recording.times[gap]), float(recording.times[gap + 1])) for gap in gaps)
    return Finding("time-gap", severity, recording.source, what, remedy, "t", rows, times, len(gaps))
