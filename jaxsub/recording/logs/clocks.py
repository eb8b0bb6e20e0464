"""Stamps that cannot be right: single ones far from all others, and channels on clocks that never meet."""

from collections.abc import Mapping

import numpy as np

from ...errors import InputError
from ...findings import Finding
from .log import Series

_FAR = 6.0 * 3600.0  # s from all other samples: a stamp that is a day off, or in 1970
_BOOT, _SINCE_1970 = 1e8, 5e8  # s: three years since a computer began, and the year 1985
_FEW = 0.1  # no more than this part of a channel is dropped
_REMEDY = "see whether clocks differ"


def without_strays(series: Mapping[str, Series], source: str) -> tuple[dict[str, Series], tuple[Finding, ...]]:
    """The series without single samples far from the bulk of all, and a warning for each that lost some.

    Raises InputError where so many are far away that none of both parts can be called the bulk.
    """
    bulks = {name: _bulk(one.times) for name, one in series.items()}
    low, high = min(b[0] for b in bulks.values()), max(b[1] for b in bulks.values())
    margin = max(_FAR, 3.0 * max(b[1] - b[0] for b in bulks.values()))
    kept, findings = {}, []
    for name, one in series.items():
        stray = (one.times < low - margin) | (one.times > high + margin)
        kept[name] = Series(one.times[~stray], one.values[~stray], one.unit)
        if count := int(stray.sum()):
            times = one.times[stray]
            at = f"{times[0]:.10g} s" if count == 1 else f"{times.min():.10g} to {times.max():.10g} s"
            what = f"{count} of {len(stray)} samples are dated {at}, far from the others ({low:.10g} to {high:.10g} s)"
            if count > _FEW * len(stray):
                raise InputError(f"{source}, column {name!r}", what, _REMEDY)
            remedy = "dropped; mend their times to keep them"
            findings.append(Finding("stray-time", "warning", source, what, remedy, channel=name, count=count))
    return kept, tuple(findings)


def require_common_clock(series: Mapping[str, Series], source: str) -> None:
    """Raise InputError where columns fall into two groups whose times lie much further apart than each is long.

    Times since boot and since 1970 do. A command that was sent once before all else began does not.
    """
    for name, one in series.items():
        start, end = float(one.times.min()), float(one.times.max())
        if start < _BOOT and end > _SINCE_1970:
            what = f"is dated from {start:.10g} to {end:.10g} s, partly since boot and partly since 1970"
            raise InputError(f"{source}, column {name!r}", what, _REMEDY)
    spans = sorted((float(one.times.min()), float(one.times.max()), name) for name, one in series.items())
    for index in range(1, len(spans)):
        before, after = spans[:index], spans[index:]
        start, end = before[0][0], max(span[1] for span in before)
        begin, last = after[0][0], max(span[1] for span in after)
        if begin - end > max(_FAR, 10.0 * (end - start), 10.0 * (last - begin)):
            names = [", ".join(span[2] for span in part) for part in (before, after)]
            what = f"the columns have no time in common ({names[0]} from {start:.10g} to {end:.10g} s, "
            raise InputError(source, f"{what}{names[1]} from {begin:.10g} to {last:.10g} s)", _REMEDY)


def _bulk(times: np.ndarray) -> tuple[float, float]:
    """First and last time of the largest part without a long pause."""
    ordered = np.sort(times)
    cuts = np.flatnonzero(np.diff(ordered) > _FAR) + 1
    parts = np.split(ordered, cuts)
    largest = max(parts, key=len)
    if len(largest) < (1.0 - _FEW) * len(ordered):
        return float(ordered[0]), float(ordered[-1])  # a log with pauses
    return float(largest[0]), float(largest[-1])
