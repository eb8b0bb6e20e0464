"""Values that stand for a missing sample."""

import math

import numpy as np

from ..findings import Finding
from ..recording import Recording
from .channels import Channel
from .spans import at_rows, counted

_PASSES = 4  # different sentinels in one channel
_WORDS = (
    -1.0, -99.0, -99.9, -99.99, -999.0, -999.9, -999.99, -9999.0, -9999.9, -99999.0, -999999.0, -32768.0, -32767.0,
    -32.768, -32.767, -327.68, -3276.8, -128.0, 255.0, 65535.0, 65.535, 655.35, 6553.5, 4294967295.0, 2147483647.0,
    -2147483648.0, 1e10, 1e15, 1e20, 1e30, 1e35, 1e36, 1e37, 1e38, 9.969209968386869e36, 3.4028234663852886e38,
)  # fmt: skip
_LIST = np.abs([*_WORDS, 99.0, 999.0, 9999.0, 32767.0, 32.767, 327.67, 3276.7])
# what a reader multiplies by on its way to SI: degrees, milli, centi, knots, revolutions a minute, feet, kilo
_FACTORS = np.array([1.0, math.pi / 180.0, 1e-3, 1e-2, 0.1, 0.5144444444, math.pi / 30.0, 0.3048, 1e3, 1e4])
_KNOWN = np.unique(np.outer(_LIST, _FACTORS))
_NEAR = 1e-6  # relative; float32 columns are no closer


def sentinels(recording: Recording, channel: Channel, values: np.ndarray) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) without those that stand for a missing sample, and what was found.

    A sentinel is the largest or the least value, occurs twice or more to the last digit, and lies alone: from all other
    values by their range if it is one of the usual numbers (-999, -32.768, 1e35 …, also converted to SI), else by five
    times that. An input needs every value, so one there is an error.
    """
    values, findings = values.copy(), []
    for _ in range(_PASSES):
        value = _sentinel(values, channel.role == "measured")
        if value is None:
            break
        chosen = values == value
        what = f"{counted(chosen, values)} {{}} sentinel {value:.7g} {channel.unit}".rstrip()
        if channel.role != "measured":
            what, remedy = (
                what.format("hold the"),
                "fill them in or cut the run there: an input acts between the rows too",
            )
            findings.append(at_rows("sentinel", "error", recording, channel, chosen, what, remedy))
        else:
            what, remedy = what.format("masked as"), "leave those cells blank if that is what they mean"
            findings.append(at_rows("sentinel", "warning", recording, channel, chosen, what, remedy))
        values[chosen] = np.nan
    return values, findings


def _sentinel(values: np.ndarray, any_number: bool) -> float | None:
    there = values[np.isfinite(values)]
    if there.size < 4:
        return None
    for extreme in (float(there.min()), float(there.max())):
        equal = there == extreme
        count, rest = int(np.count_nonzero(equal)), there[~equal]
        if extreme == 0.0 or count < 2 or rest.size < 2:
            continue
        low, high = np.percentile(rest, (0.5, 99.5))
        away = min(abs(extreme - low), abs(extreme - high))
        alone = float(np.min(np.abs(rest - extreme)))
        width = float(high - low)
        known = bool(np.any(np.abs(_KNOWN - abs(extreme)) <= _NEAR * _KNOWN))
        size = float(np.median(np.abs(rest)))
        if known and away > max(width, 3.0 * size) and alone > 0.2 * away and width > 0.0:
            return extreme
        unlike = alone > 5.0 * max(float(np.ptp(rest)), size) and width > 0.0
        if any_number and unlike and count >= 3:
            return extreme
    return None
