"""Whole turns of a measured angle: where they are counted, and where a column shows that it is a wrapped angle."""

import numpy as np
from jaxtyping import Float

_TURN = 2.0 * np.pi
# how far, of a turn, values may lie outside of one, and a jump's remainder be from what the angle does elsewhere
_SLACK = 1e-3
_USUAL = 4.0


def without_jumps(times: Float[np.ndarray, " k"], angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"] | None:
    """An angle (rad, NaN where nothing was measured) that goes on over whole turns; None where these are in doubt.

    They are beyond doubt if it turns less than a quarter between any two samples that follow each other, at the fastest
    rate at which it turns between any two. So a course over ground of a vehicle that lies still, and a heading with a
    gap in which it may have turned about, are left as they were recorded.
    """
    whole = unwrapped(angle)
    measured = np.flatnonzero(np.isfinite(angle))
    between = np.diff(times[measured])
    fastest = np.max(np.abs(np.diff(whole[measured])) / between, initial=0.0)
    return whole if fastest * np.max(between, initial=0.0) < 0.5 * np.pi else None


def unwrapped(angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """An angle (rad, NaN where nothing was measured) that turns by the shorter way between samples."""
    whole, measured = angle.copy(), np.isfinite(angle)
    whole[measured] = np.unwrap(angle[measured])
    return whole


def unwrapped_mechanism(angle: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"] | None:
    """A column (NaN where nothing was measured) as an angle without jumps, if it can be nothing else; None otherwise.

    It lies within one turn from 0 or ±π, jumps by most of a turn between neighbours, and over each jump moves by the
    shorter way no further than it does elsewhere. The median is brought within half a turn of zero, about which a
    spring acts.
    """
    there = angle[np.isfinite(angle)]
    if there.size < 4:
        return None
    low, high = float(there.min()), float(there.max())
    slack = _SLACK * _TURN
    one_turn = (low >= -slack and high <= _TURN + slack) or (low >= -np.pi - slack and high <= np.pi + slack)
    changes = np.diff(there)
    jumps = np.abs(changes) > np.pi
    if not one_turn or not jumps.any() or jumps.mean() > 0.5:
        return None
    usual = float(np.percentile(np.abs(changes[~jumps]), 99.0))
    over = np.abs(np.abs(changes[jumps]) - _TURN)
    if usual > 0.5 * np.pi or np.any(over > _USUAL * usual + 1e-9):
        return None
    whole = unwrapped(angle)
    return whole - _TURN * np.round(float(np.median(whole[np.isfinite(whole)])) / _TURN)
