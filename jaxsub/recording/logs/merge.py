"""Channels that were sampled at different times, put onto one column of times."""

from collections.abc import Collection, Mapping

import numpy as np

from ...errors import InputError
from ..recording import Recording
from .clocks import require_common_clock, without_strays
from .log import Series

_TICK = 1e-6  # s
_MOST = 1e8  # rows
_ANGLES = ("phi", "theta", "psi")
_ANGULAR = ("heading", "yaw", "course", "bearing", "compass", "azimuth")


def merged(
    series: Mapping[str, Series],
    name: str,
    source: str,
    *,
    held: Collection[str] = (),
    interpolated: Collection[str] = (),
    every: float | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Recording:
    """The run `name` of SI samples by column, whose times count from the first sample of them all, s.

    The rows are all times, to 1 µs, at which an output or a held input was sampled, and an output is missing in the
    others. With `every` (s) the rows stand that far apart: each output's sample goes to the nearest row, the nearer of
    two, so that its time is rounded by half of `every` at most. In each row a `held` column has its last sample so far
    and an `interpolated` one lies between two, if it is an angle by the shorter way. What comes before or after these
    are known is cut off, and so is what lies outside `start` to `end`. Single stamps far from all others are dropped
    and reported. Raises InputError where nothing is left, of all columns or of one, and for clocks that never meet.
    """
    known = {column: _known(one) for column, one in series.items()}
    for column, (times, _, _) in known.items():
        if not times.size:
            raise InputError(f"{source}, column {column!r}", "its channel holds no number", "leave the column out")
    known, findings = without_strays(known, source)
    require_common_clock(known, source)
    origin = min(times.min() for times, _, _ in known.values())
    tidy = {column: _tidy(one, origin) for column, one in known.items()}
    for column in set(interpolated) & set(tidy):
        if _is_wrapped(column, known[column].unit, tidy[column][1]):
            tidy[column] = (tidy[column][0], np.unwrap(tidy[column][1]))
    sampled = [times for column, (times, _) in tidy.items() if column not in interpolated]
    rows = np.unique(np.concatenate(sampled or [times for times, _ in tidy.values()]))
    if every is not None:
        if (rows[-1] - rows[0]) / every > _MOST:
            what = f"rows every {every:g} s from {rows[0]:.6g} to {rows[-1]:.6g} s are more than {_MOST:g}"
            raise InputError(source, what, "set a longer `every`")
        rows = every * np.arange(np.floor(rows[0] / every), np.ceil(rows[-1] / every) + 1.0)
    first = max([tidy[c][0][0] for c in (*held, *interpolated) if c in tidy], default=rows[0])
    last = min([tidy[c][0][-1] for c in interpolated if c in tidy], default=rows[-1])
    low, high = (rows[0] if start is None else start), (rows[-1] if end is None else end)
    rows = rows[(rows >= max(first, low)) & (rows <= min(last, high))]
    if rows.size < 2:
        raise InputError(source, f"the columns have no time in common ({_spans(tidy)})", "see whether clocks differ")
    columns = {c: _onto(rows, *tidy[c], c in held, c in interpolated, every) for c in tidy}
    for column, values in columns.items():
        if np.isnan(values).all():
            what = f"has no sample in the rows from {rows[0]:.6g} to {rows[-1]:.6g} s ({_spans(tidy)})"
            raise InputError(f"{source}, column {column!r}", what, "see whether clocks differ, or leave it out")
    return Recording(name, rows, columns, source, findings=findings)


def _is_wrapped(column: str, unit: str, values: np.ndarray) -> bool:
    """Whether a column is an angle, rad, between limits a turn apart, such as a compass that passes through north."""
    named = column in _ANGLES or any(word in column.lower() for word in _ANGULAR)
    return (unit == "rad" or (not unit and named)) and float(np.ptp(values)) <= 2.0 * np.pi * (1.0 + 1e-6)


def _known(series: Series) -> Series:
    """Without missing samples."""
    kept = np.isfinite(series.times) & ~np.isnan(series.values)
    return Series(series.times[kept], series.values[kept], series.unit)


def _tidy(series: Series, origin: float) -> tuple[np.ndarray, np.ndarray]:
    """In order of time from `origin`; of several at one time the last to be written.

    Times are rounded, so that two clocks' stamps of one moment make one row and no interval of a nanosecond.
    """
    times = np.round((series.times - origin) / _TICK) * _TICK
    _, from_the_end = np.unique(times[::-1], return_index=True)
    index = len(times) - 1 - from_the_end
    return times[index], series.values[index]


def _onto(
    rows: np.ndarray, times: np.ndarray, values: np.ndarray, held: bool, interpolated: bool, every: float | None
) -> np.ndarray:
    if held:
        return values[np.searchsorted(times, rows, side="right") - 1]
    if interpolated:
        return np.interp(rows, times, values)
    cells = np.full(len(rows), np.nan)
    row = np.clip(np.searchsorted(rows, times), 1, len(rows) - 1)
    row -= times - rows[row - 1] <= rows[row] - times
    distance = np.abs(times - rows[row])
    near = np.flatnonzero(distance <= (0.0 if every is None else 0.5 * every * (1.0 + 1e-9)))
    # of two samples nearest to one row the nearer is written last
    near = near[np.argsort(-distance[near], kind="stable")]
    cells[row[near]] = values[near]
    return cells


def _spans(tidy: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> str:
    return ", ".join(f"{c} from {times[0]:.6g} to {times[-1]:.6g} s" for c, (times, _) in tidy.items())
