"""Whole turns of a measured angle, where there is no doubt how many there are."""

import numpy as np
from jaxtyping import Float

_TURN = 2.0 * np.pi


def without_jumps(times: Float[np.ndarray, " k"], angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"] | None:
    """An angle (rad, NaN where nothing was measured) that goes on over whole turns; None where these are in doubt.

    They are beyond doubt if it turns less than a quarter between any two samples that follow each other, at the fastest
    rate at which it turns between any two. So a course over ground of a vehicle that lies still, and a heading with a
    gap in which it may have turned about, are left as they were recorded.
    """
    measured = np.flatnonzero(np.isfinite(angle))
    change, between = np.diff(angle[measured]), np.diff(times[measured])
    turns = np.round(change / _TURN)
    fastest = np.max(np.abs(change - _TURN * turns) / between, initial=0.0)
    if fastest * np.max(between, initial=0.0) >= 0.25 * _TURN:
        return None
    whole = angle.copy()
    whole[measured[1:]] -= _TURN * np.cumsum(turns)
    return whole
