r"""What the simulation error on the test runs says of a verdict: how much of it is explained, and what is left.

Errors are held against the noise $s$ of a channel: σ where it is stated, else the white part of what the improved model
leaves of the training runs, since an estimated σ is as large as whatever the baseline lacks. The excess variance of a
channel is $\overline{e^2}/s^2 - 1$.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from ...estimate.assessment import Assessment, assess_residuals
from ...likelihood import open_loop_errors
from ...recording import Recording
from .. import settings
from ..accept.verdict import Judged
from ..linearise.view import View
from ..records.decisions import Decision
from ..records.diagnosis import ChannelQuality, Explained
from .validation import stacked_columns

# simulations with random forces, of every run
_DRAWS, _SEED = 32, 0
# channels that a sentence lists
_LISTED = 4


def noise(quality: Sequence[ChannelQuality]) -> Float[np.ndarray, " c"]:
    """The noise of channels of a `quality`, SI."""
    white = [one.record_sigma if one.sigma_estimated else one.sigma for one in quality]
    return np.maximum(white, np.finfo(float).tiny)


def compared(
    before: Mapping[str, float],
    after: Mapping[str, float],
    low: Mapping[str, float],
    expected: Mapping[str, float],
    assessment: Assessment,
) -> Explained:
    """What the improved model removes of the baseline's excess variance on the test runs, and what it leaves.

    `before` and `after` are the two models' rms there by channel, over its noise, and `low` the low ends of the first
    one's intervals; `expected` are the `expected_errors` of the second where any is too large, and `assessment` the
    tests of what it leaves.
    """
    excess = lambda rms: sum(max(value**2 - 1.0, 0.0) for value in rms.values())
    runs = all(math.isfinite(value) for value in before.values())
    # a share of an excess that is none would be noise over noise
    significant = any(value > 1.0 for value in low.values())
    share = 1.0 - excess(after) / excess(before) if runs and assessment.runs_model and significant else None
    left = {one.channel: after[one.channel] for one in assessment.oversized}
    return Explained(share, left, runs, assessment.runs_model, {channel: expected[channel] for channel in left})


def assessed(
    error: Sequence[Float[np.ndarray, "k c"]],
    recordings: Sequence[Recording],
    columns: Mapping[str, str],
    scale: Float[np.ndarray, " c"],
) -> Assessment:
    """The tests of size, whiteness and spikes of a model's simulation `error` on `recordings`, a run each, in SI.

    `columns` has the measured column of each output, and `scale` its noise, SI.
    """
    pairs = [stacked_columns([run.column(column) for run in recordings]) for column in columns.values()]
    mask = np.stack([there for _, there in pairs], axis=-1)
    whitened = np.stack([run[: mask.shape[1]] / scale for run in error])
    return assess_residuals(tuple(columns), np.where(mask, whitened, 0.0), mask)


def expected_errors(view: View, scale: Float[np.ndarray, " c"], quality: Sequence[ChannelQuality]) -> dict[str, float]:
    """By channel the rms that noise and a view's disturbance leave in a simulation, its initial states fitted.

    It is over `scale`, SI. The white part of the residuals, by the `quality` of the channels, is noise too where it is
    more than that, as of a sensor with outliers or a σ that is stated too small.

    A force counts that changes within a block of a run (`BLOCKS`): what is slower is no more random in a run than
    missing physics is.
    """
    system, disturbance = view.followed.system, view.disturbance
    block = float(np.max(np.sum(np.asarray(system.intervals), axis=1))) / settings.BLOCKS
    random = np.where(np.asarray(disturbance.time) < block, disturbance.force, 0.0)
    measured = np.asarray(system.measured)
    draws = np.random.default_rng(_SEED).standard_normal((*measured.shape[:2], len(random), _DRAWS))
    errors = open_loop_errors(dataclasses.replace(disturbance, force=random), system, draws)
    samples = np.maximum(np.sum(measured, axis=(0, 1)), 1)
    squares = np.sum(np.mean(errors**2, axis=-1), axis=(0, 1)) / samples
    white = np.maximum(1.0, [one.record_sigma for one in quality] / scale)
    rms = np.sqrt(white**2 + squares * (np.asarray(view.sigma) / scale) ** 2)
    return dict(zip(view.vehicle.layout.channels, rms.tolist(), strict=True))


def consistent(judged: Judged, found: Explained, low: Mapping[str, float], assessment: Assessment) -> Judged:
    """The verdict, unless it is `none` and the test runs' error is far above what is random: then `unknown`, and why.

    `low` are the low ends of the intervals of the last model's error there over the noise, by channel, and `assessment`
    has the tests of it, of which the one of size then has the mismatch's p-value.
    """
    if judged.verdict != "none":
        return judged
    # the 95 % interval of a channel's error lies far above what is random, which no `none` may leave
    over = {channel: low[channel] / found.random[channel] for channel in found.left}
    most = max(over.values(), default=0.0) if found.improved_runs else math.inf
    test = "low end of the test error's interval over what noise and disturbance leave"
    decision = Decision(
        "mismatch", test, most, settings.LARGE_ERROR, "large" if most > settings.LARGE_ERROR else "not large"
    )
    judged = dataclasses.replace(judged, decisions=[*judged.decisions, decision])
    if most <= settings.LARGE_ERROR:
        return judged
    large = {channel: found.left[channel] for channel in over if over[channel] > settings.LARGE_ERROR}
    size = f"Simulation error on the test runs is {sigmas(large)}"
    why = size if found.improved_runs else "The model diverges on the test runs"
    note = f"{why}, although no missing effect is significant: the verdict is unknown and not none."
    p_value = judged.p_value if assessment.size is None else min(judged.p_value, assessment.size)
    return dataclasses.replace(judged, verdict="unknown", p_value=p_value, notes=[*judged.notes, note])


def sigmas(rms: Mapping[str, float]) -> str:
    """`1.4 σ in psi, 1.2 σ in r`, the largest first."""
    ranked = sorted(rms.items(), key=lambda item: -item[1])
    more = f" and more than noise in {len(ranked) - _LISTED} others" if len(ranked) > _LISTED else ""
    return ", ".join(f"{value:.3g} σ in {channel}" for channel, value in ranked[:_LISTED]) + more
