"""Whole turns of a measured angle, where there is no doubt how many there are."""

import numpy as np
from jaxtyping import Float


def without_jumps(times: Float[np.ndarray, " k"], angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"] | None:
    """An angle (rad, NaN where nothing was measured) that goes on over whole turns; None where these are in doubt.

    They are beyond doubt if it turns less than a quarter between any two samples that follow each other, at the fastest
    rate at which it turns between any two. So a course over ground of a vehicle that lies still, and a heading with a
    gap in which it may have turned about, are left as they were recorded.
    """
    measured = np.flatnonzero(np.isfinite(angle))
    whole, between = angle.copy(), np.diff(times[measured])
    whole[measured] = np.unwrap(angle[measured])
    fastest = np.max(np.abs(np.diff(whole[measured])) / between, initial=0.0)
    return whole if fastest * np.max(between, initial=0.0) < 0.5 * np.pi else None
