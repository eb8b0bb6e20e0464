"""Rows whose times do not increase, of files that are taken as far as they are sound."""

import bisect

import numpy as np

from ..errors import InputError
from ..findings import Finding

_LEAST = 0.5  # of the rows; a file with fewer in order has no order


def in_order(times: np.ndarray) -> np.ndarray:
    """Numbers of the most rows, (k,), whose finite `times` (n,), s, increase: a longest increasing subsequence.

    One stamp far ahead is left out, and not all that come after it.
    """
    finite = np.flatnonzero(np.isfinite(times))
    if np.all(np.diff(times[finite]) > 0.0):
        return finite
    tails: list[float] = []
    rows: list[int] = []
    before = np.full(len(times), -1)
    for row, time in zip(finite.tolist(), times[finite].tolist(), strict=True):
        length = bisect.bisect_left(tails, time)
        before[row] = rows[length - 1] if length else -1
        if length == len(tails):
            tails.append(time)
            rows.append(row)
        elif time < tails[length]:
            tails[length], rows[length] = time, row
    kept = [rows[-1]]
    while before[kept[-1]] >= 0:
        kept.append(int(before[kept[-1]]))
    return np.array(kept[::-1])


def disorder(source: str, times: np.ndarray, kept: np.ndarray, first_row: int) -> Finding:
    """A warning that counts the rows that were not `kept`. Raises InputError where they are more than half."""
    left_out = np.ones(len(times), bool)
    left_out[kept] = False
    lost = np.flatnonzero(left_out)
    untimed = int(np.count_nonzero(~np.isfinite(times)))
    repeated = int(np.count_nonzero(np.isin(times[lost], times[kept])))
    what = (
        f"{lost.size} of {len(times)} rows are left out: {untimed} without a time, {repeated} repeat a time,"
        f" {lost.size - untimed - repeated} go back or jump ahead"
    )
    if kept.size < _LEAST * len(times):
        raise InputError(source, what, "sort the rows, or cut the file where its clock was set back")
    rows = tuple((first_row + int(row), first_row + int(row)) for row in lost[:10])
    return Finding("disordered-times", "warning", source, what, "mend their times to keep them", rows=rows,
                   count=int(lost.size))  # fmt: skip
