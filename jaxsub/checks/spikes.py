"""Single samples far beyond what a channel's own differences allow."""

import numpy as np

from ..findings import Finding
from ..recording import Recording
from .channels import ANGLES, Channel
from .spans import amount, at_rows, counted

_ROBUST = 1.4826  # standard deviations of a normal density in its median absolute deviation
_DEVIATIONS = 8.0
_USUAL = 4.0  # times the 95th percentile of the differences
_SIGMAS = 10.0
_QUANTA = 10.0
_RETURN = 0.6  # the lesser of rise and fall over the larger: what falls slower is the answer to a push
_FEW = 0.02  # of the samples: more are how the channel is
_SHARE = 0.05  # of the usual range: where the noise is unknown, less counts for little in a fit
_BEYOND = 3.0  # times the usual range of a held input
_WIDTHS = (1, 2)  # rows that a spike may last


def spikes(recording: Recording, channel: Channel, values: np.ndarray, body: bool) -> tuple[np.ndarray, list[Finding]]:
    """`values` (samples,) without spikes, and a warning.

    A spike leaves the samples before and after it, on one side, by more than 8 robust standard deviations and 4 times
    the 95th percentile of the channel's differences, 10 σ of its sensor, or 5 % of its usual range where σ is not
    known, and 10 steps of its resolution. A step does not come back, so it is none. A measured spike is masked, a
    prescribed one interpolated. A held input may be a pulse: a value of one row is named if it lies three times the
    usual range beyond it, and kept.
    """
    rows = np.flatnonzero(np.isfinite(values))
    if rows.size < 20:
        return values, []
    if channel.role == "held input":
        return values, _input_spikes(recording, channel, values)
    there = values[rows]
    chosen_rows, typical = _found(there, channel.sigma, body and channel.quantity in ANGLES)
    if not chosen_rows.size:
        return values, []
    chosen = np.zeros(values.shape, bool)
    chosen[rows[chosen_rows]] = True
    good = np.isfinite(values) & ~chosen
    around = np.interp(recording.times, recording.times[good], values[good])
    size = float(np.max(np.abs(values - around)[chosen]))
    done = "masked" if channel.role == "measured" else "interpolated"
    what = (
        f"{counted(chosen, values)} {done} as spikes of up to {amount(size, channel.unit)};"
        f" its differences are {amount(typical, channel.unit)}"
    )
    finding = at_rows("spike", "warning", recording, channel, chosen, what, "see whether the sensor was disturbed")
    return np.where(chosen, np.nan if channel.role == "measured" else around, values), [finding]


def _input_spikes(recording: Recording, channel: Channel, values: np.ndarray) -> list[Finding]:
    """A warning of single rows far outside of what a held input does otherwise; none where it rests otherwise."""
    low, high = np.nanpercentile(values, (1.0, 99.0))
    reach = float(high - low)
    far = (values > high + _BEYOND * reach) | (values < low - _BEYOND * reach)
    single = far & ~np.roll(far, 1) & ~np.roll(far, -1)
    if reach <= 0.0 or not single.any() or not np.array_equal(single, far) or single.mean() > 0.01:
        return []
    worst = float(values[far][np.argmax(np.abs(values[far]))])
    what = (
        f"{counted(far, values)} kept, though far outside of {amount(low)} to {amount(high, channel.unit)},"
        f" such as {amount(worst, channel.unit)}: spikes?"
    )
    remedy = "replace them by the value before if the actuator did not do that"
    return [at_rows("spike", "warning", recording, channel, far, what, remedy)]


def _usual_range(values: np.ndarray) -> float:
    low, high = np.percentile(values, (1.0, 99.0))
    return float(high - low)


def _found(values: np.ndarray, sigma: float, angle: bool) -> tuple[np.ndarray, float]:
    """Indices of the spikes among `values` (n,), and the usual size of its differences."""
    differences = _short_way(np.diff(values), angle)
    size = np.abs(differences)
    deviation = _ROBUST * float(np.median(np.abs(differences - np.median(differences))))
    moving = size[size > 0.0]
    if not moving.size:
        return np.array([], int), 0.0
    quantum = float(moving.min()) if moving.size < 0.5 * size.size else 0.0
    usual = float(np.percentile(size, 95.0))
    least = _SIGMAS * sigma if sigma else _SHARE * _usual_range(values)
    limit = max(_DEVIATIONS * deviation, _USUAL * usual, least, _QUANTA * quantum)
    chosen = np.zeros(values.shape, bool)
    # at the ends there is one side alone, on which a step looks the same
    for width in _WIDTHS:
        before, after = values[width:-width] - values[: -2 * width], values[width:-width] - values[2 * width :]
        before, after = _short_way(before, angle), _short_way(after, angle)
        less, more = np.minimum(np.abs(before), np.abs(after)), np.maximum(np.abs(before), np.abs(after))
        out = (before * after > 0.0) & (less > width * limit) & (less > _RETURN * more)
        # a motion rises to its peak and falls from it over several samples
        out[1:-1] &= _foot(size, width) < _RETURN / 2.0 * less[1:-1]
        chosen[width:-width] |= out
    index = np.flatnonzero(chosen)
    # a pulse that many samples share is a motion; so is what is there throughout
    return (index if index.size <= max(_FEW * values.size, 1.0) else index[:0]), float(np.median(moving))


def _foot(size: np.ndarray, width: int) -> np.ndarray:
    """The larger difference of the samples beyond those `width` rows before and after, of all but the ends."""
    return np.maximum(size[: -2 * width - 1], size[2 * width + 1 :])


def _short_way(changes: np.ndarray, angle: bool) -> np.ndarray:
    """Changes of an angle without whole turns."""
    return changes - 2.0 * np.pi * np.round(changes / (2.0 * np.pi)) if angle else changes
