"""Findings about rows of a recording."""

import numpy as np

from ..findings import Finding, Severity
from ..recording import Recording
from .channels import Channel

_LISTED = 100  # intervals of one finding; what is beyond them is in its last


def intervals(chosen: np.ndarray) -> tuple[tuple[int, int], ...]:
    """First and last index of each stretch where `chosen` (samples,) is true.

    There are at most a hundred; the last of them reaches to the end of the last stretch.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], chosen, [False]])))
    pairs = [(int(first), int(after) - 1) for first, after in edges.reshape(-1, 2)[:_LISTED]]
    if len(edges) // 2 > _LISTED:
        pairs[-1] = (pairs[-1][0], int(edges[-1]) - 1)
    return tuple(pairs)


def at_rows(
    check: str,
    severity: Severity,
    recording: Recording,
    channel: Channel | None,
    chosen: np.ndarray,
    what: str,
    remedy: str = "",
) -> Finding:
    """A finding about the samples where `chosen` (samples,) is true."""
    spans = intervals(chosen)
    return Finding(
        check,
        severity,
        recording.source,
        what,
        remedy,
        channel.name if channel else "",
        tuple((recording.first_row + first, recording.first_row + last) for first, last in spans),
        tuple((float(recording.times[first]), float(recording.times[last])) for first, last in spans),
        int(np.count_nonzero(chosen)),
    )


def of_run(
    check: str, severity: Severity, recording: Recording, channel: str, what: str, remedy: str = "", count: int = 0
) -> Finding:
    """A finding about a whole run, or a channel of it."""
    return Finding(check, severity, recording.source, what, remedy, channel, count=count)


def counted(chosen: np.ndarray, of: np.ndarray) -> str:
    """`100 rows (5 %)`: how many samples of a channel are `chosen`, and what share of those measured in `of`."""
    count, total = int(np.count_nonzero(chosen)), max(int(np.count_nonzero(np.isfinite(of))), 1)
    share = 100.0 * count / total
    text = f"{share:.0f}" if share >= 1.0 else f"{share:.1g}"
    return f"{count} {'row' if count == 1 else 'rows'} ({text} %)"


def amount(value: float, unit: str = "") -> str:
    """A value to four digits with its unit."""
    return f"{value:.4g}{f' {unit}' if unit else ''}"
