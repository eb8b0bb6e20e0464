"""Values that repeat: a constant or stuck channel, a slow sensor in fast rows, a channel that is clipped."""

import math

import numpy as np

from ..findings import Finding
from ..recording import Recording
from .channels import Channel
from .spans import amount, at_rows, counted, of_run

_FEWEST = 10  # samples: of fewer nothing is said
_NOISY = 0.3  # of the samples repeat their neighbour: beyond it a channel is coarse, and a long repeat is no fault
_CHANCE = 1e-6  # that so long a repeat is in a run by chance
_SIDE = 24  # rows looked at on either side of a stretch
_SLOW = 0.3  # of the usual difference there
_REGULAR = 0.95  # of the repeats have the slow sensor's length
_CHANGES = 20
_PILE = 2.0  # times the samples within a usual difference of it
_CLIPPED = 0.01  # of the samples


def constant(recording: Recording, channel: Channel, values: np.ndarray) -> list[Finding]:
    """A warning where a measured channel never changes: it has not the noise that the vehicle says."""
    there = values[np.isfinite(values)]
    if channel.role != "measured" or there.size < _FEWEST or float(np.ptp(there)) > 0.0:
        return []
    what = f"is {amount(float(there[0]), channel.unit)} in all {there.size} samples"
    remedy = f"leave the column {channel.name!r} out if its sensor was off"
    return [of_run("constant", "warning", recording, channel.name, what, remedy, int(there.size))]


def slow_sensor(recording: Recording, channel: Channel, values: np.ndarray) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) with each reading of a slow sensor once, and a note.

    A sensor is slow if its value changes only every m-th row, throughout. Steps of one quantum at even distances are a
    coarse ramp and not a slow sensor. Between its readings a prescribed motion is interpolated.
    """
    rows = np.flatnonzero(np.isfinite(values))
    if channel.role == "held input" or rows.size < 2 * _CHANGES:
        return values, []
    fresh = _fresh(values[rows])
    if fresh is None:
        return values, []
    kept = rows[fresh]
    repeated = np.zeros(values.shape, bool)
    repeated[rows] = True
    repeated[kept] = False
    every = rows.size / kept.size
    what = f"repeats each reading {every:.3g} times: {counted(repeated, values)} "
    if channel.role == "prescribed":
        what += f"interpolated between {kept.size} readings"
        mended = np.interp(recording.times, recording.times[kept], values[kept])
    else:
        what += f"masked, {kept.size} readings taken once"
        mended = np.where(repeated, np.nan, values)
    return mended, [of_run("slow-sensor", "note", recording, channel.name, what, count=int(repeated.sum()))]


def _fresh(values: np.ndarray) -> np.ndarray | None:
    """Where among `values` (n,) a slow sensor gave a new reading; None where none did."""
    changes = np.flatnonzero(np.diff(values)) + 1
    if changes.size < _CHANGES or changes.size > 0.55 * values.size:
        return None
    lengths, steps = np.diff(changes), np.abs(values[changes] - values[changes - 1])
    coarse = np.mean(steps > 1.5 * steps.min()) < 0.3
    period = int(np.bincount(lengths).argmax())
    if period < 2:
        return None
    multiple = lengths % period == 0
    if np.mean(multiple) >= _REGULAR and not (coarse and np.sum(multiple & (lengths > period)) < 3):
        phase = int(np.bincount(changes % period).argmax())
        return np.flatnonzero(np.arange(values.size) % period == phase)
    # a slow sensor whose period is no whole number of rows
    if not coarse and np.mean((lengths == period) | (np.abs(lengths - period) == 1) & (lengths > 1)) >= _REGULAR:
        return np.concatenate([[0], changes])
    return None


def stuck(recording: Recording, channel: Channel, values: np.ndarray) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) without stretches of one value in a channel that otherwise changes at every row.

    A stretch is too long if chance would give one so long in a run in a million, at the share of rows that repeat
    their neighbour outside of long stretches. It also begins and ends suddenly: a vehicle that comes to rest, or a
    coarse sensor at the end of a swing, slows down before.
    """
    rows = np.flatnonzero(np.isfinite(values))
    if channel.role != "measured" or rows.size < 5 * _FEWEST:
        return values, []
    there = values[rows]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(there)) + 1, [there.size]])
    lengths = np.diff(edges)
    short = lengths[lengths < _FEWEST]
    if short.sum() < 2 * _FEWEST:
        return values, []
    share = float(np.sum(short - 1)) / float(short.sum())
    if share > _NOISY:
        return values, []
    longest = max(_FEWEST, math.ceil(math.log(_CHANCE / there.size) / math.log(max(share, 0.01))))
    long = lengths >= longest
    for index in np.flatnonzero(long):
        long[index] = _sudden(there, int(edges[index]), int(edges[index + 1]))
    if not long.any():
        return values, []
    chosen = np.zeros(values.shape, bool)
    chosen[rows] = np.repeat(long, lengths)
    level = float(there[edges[:-1][long][0]])
    among = f"{amount(level, channel.unit)}" if np.all(there[edges[:-1][long]] == level) else "one value each"
    stretches = f"{int(long.sum())} {'stretch' if long.sum() == 1 else 'stretches'}"
    what = f"{counted(chosen, values)} masked as stuck at {among} in {stretches} of {longest} rows or more"
    finding = at_rows("stuck", "warning", recording, channel, chosen, what, "see whether the sensor had dropped out")
    return np.where(chosen, np.nan, values), [finding]


def _sudden(values: np.ndarray, first: int, after: int) -> bool:
    """Whether the stretch of `values` (n,) from `first` until before `after` has motion up to both its ends."""
    before = np.abs(np.diff(values[max(first - _SIDE, 0) : first]))
    behind = np.abs(np.diff(values[after : after + _SIDE]))
    if min(before.size, behind.size) < _SIDE // 2:
        return False
    # a coarse sensor at rest shows two or three levels
    levels = min(np.unique(values[first - before.size - 1 : first]).size, np.unique(values[after : after + _SIDE]).size)
    moving = levels > _SIDE // 3 and all(np.mean(side == 0.0) <= 0.1 for side in (before, behind))
    # a sensor that repeats its last value does not jump to it, but from it
    jump = max(abs(values[after] - values[after - 1]), abs(values[first] - values[first - 1]))
    leaves = jump >= _SLOW * np.median(behind)
    slowing = np.median(before[-5:]) < 0.1 * np.median(before)
    return bool(moving and leaves and not slowing)


def clipped(recording: Recording, channel: Channel, values: np.ndarray) -> list[Finding]:
    """A warning where a measured channel stays at an extreme more than once, and is seldom close to it."""
    there = values[np.isfinite(values)]
    if channel.role != "measured" or there.size < 5 * _FEWEST:
        return []
    findings = []
    for extreme in (float(there.min()), float(there.max())):
        count = int(np.count_nonzero(there == extreme))
        if count < max(_FEWEST, _CLIPPED * there.size) or count > 0.9 * there.size:
            continue
        steps = np.abs(np.diff(there))
        # a swing of a channel slows down before its end, and leaves many samples close to it
        close = np.abs(there - extreme) <= 1.5 * np.median(steps[steps > 0.0])
        inside = int(np.count_nonzero(close)) - count
        runs = np.diff(np.flatnonzero(np.diff(np.concatenate([[0], values == extreme, [0]]))))[::2]
        if np.unique(there).size < _FEWEST or count < _PILE * inside or np.count_nonzero(runs >= 3) < 2:
            continue
        what = f"{counted(values == extreme, values)} at its extreme of {amount(extreme, channel.unit)}: clipped?"
        remedy = "blank those cells, or give the sensor its limits as an effect sensor-saturation"
        findings.append(at_rows("clipped", "warning", recording, channel, values == extreme, what, remedy))
    return findings
