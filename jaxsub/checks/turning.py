"""Angles that jump by whole turns."""

import numpy as np

from ..findings import Finding
from ..recording import Recording
from ..recording.turns import unwrapped, unwrapped_mechanism, without_jumps
from .channels import ANGLES, Channel
from .spans import at_rows


def turning(recording: Recording, channel: Channel, values: np.ndarray, body: bool) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) as an angle without jumps, and a note where it had some.

    A body's prescribed angle turns by the shorter way between samples, since it is interpolated there; a warning says
    so where it may have turned further. Its measured angles stay as recorded where turns are in doubt. A mechanism's
    column loses jumps that only a wrapped angle has.
    """
    if body and channel.quantity not in ANGLES:
        return values, []
    severity, doubt = "note", ""
    if body and channel.role == "prescribed":
        whole = unwrapped(values)
        if without_jumps(recording.times, values) is None:
            severity, doubt = "warning", ", by the shorter way, though it may turn by over a quarter between samples"
    elif body:
        whole = without_jumps(recording.times, values)
    else:
        rad = recording.units.get(channel.name, "rad") == "rad"
        whole = unwrapped_mechanism(values) if rad else None
    if whole is None:
        return values, []
    rows = np.flatnonzero(np.isfinite(values))
    turned = np.diff(np.round((whole - values)[rows] / (2.0 * np.pi)))
    jumps = np.zeros(values.shape, bool)
    jumps[rows[1:][turned != 0.0]] = True
    if not jumps.any():
        return whole, []
    count = int(np.count_nonzero(jumps))
    what = f"unwrapped: {count} {'jump' if count == 1 else 'jumps'} of a whole turn{doubt}"
    remedy = "sample it faster" if doubt else ""
    return whole, [at_rows("wrapped-angle", severity, recording, channel, jumps, what, remedy)]
