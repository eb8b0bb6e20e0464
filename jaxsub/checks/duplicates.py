"""The same run given twice."""

from collections.abc import Sequence

import numpy as np

from ..findings import Finding
from ..recording import Recording


def duplicates(runs: Sequence[Recording], held_out: Sequence[Recording] = ()) -> list[Finding]:
    """An error for each run whose samples are those of an earlier one, whatever the files are called.

    A run that is fitted and tested is judged by what it was fitted to; one that is fitted twice counts twice.
    """
    findings, seen = [], {}
    for index, recording in enumerate([*runs, *held_out]):
        key = len(recording.times)
        for other, earlier in seen.get(key, []):
            if _equal(earlier, recording):
                role = "as a run and held out" if other < len(runs) <= index else "twice"
                what = f"holds the samples of {earlier.source}: the same run {role}"
                findings.append(Finding("same-run", "error", recording.source, what, "give every run once"))
                break
        seen.setdefault(key, []).append((index, recording))
    return findings


def _equal(one: Recording, other: Recording) -> bool:
    shared = sorted(one.columns.keys() & other.columns.keys())
    if not shared or one.columns.keys() != other.columns.keys():
        return False
    same = all(np.array_equal(one.columns[name], other.columns[name], equal_nan=True) for name in shared)
    # the same run with a clock that starts elsewhere
    steps = np.diff(one.times)
    return same and np.allclose(steps, np.diff(other.times), rtol=0.0, atol=1e-3 * float(np.median(steps)))
