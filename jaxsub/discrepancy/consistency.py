r"""What the simulation error on the test runs says of a verdict: how much of it is explained, and what is left.

The excess variance of a channel is $\overline{e^2}/\sigma^2 - n$, of which the noise floor $n$ is 1 where σ is stated,
and the white part of the recording where it is not.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from ..estimate.assessment import Assessment, assess_residuals
from ..likelihood import open_loop_errors
from ..recording import Recording
from .decisions import Decision
from .diagnosis import ChannelQuality, Explained, Remainder
from .settings import BLOCKS, LARGE_ERROR, LISTED
from .validation import stacked_columns
from .verdict import Judged
from .view import View

# simulations with random forces, of every run
_DRAWS, _SEED = 32, 0


def compared(
    before: Mapping[str, float],
    after: Mapping[str, float],
    baseline: Mapping[str, Remainder],
    quality: Sequence[ChannelQuality],
    expected: Mapping[str, float],
    assessment: Assessment,
) -> Explained:
    """What the improved model removes of the baseline's excess variance on the test runs, and what it leaves.

    `before` and `after` are rms/σ of the two models there by channel, `baseline` is what the first one leaves,
    `expected` the `expected_errors` of the second where any is too large, and `assessment` the tests of what it leaves.
    """
    floor = {one.channel: (one.record_sigma / one.sigma) ** 2 if one.sigma_estimated else 1.0 for one in quality}
    excess = lambda rms: sum(max(value**2 - floor[channel], 0.0) for channel, value in rms.items())
    runs = all(math.isfinite(value) for value in before.values())
    # a share of an excess that is none would be noise over noise
    significant = any(one.low**2 > floor[channel] for channel, one in baseline.items())
    share = 1.0 - excess(after) / excess(before) if runs and assessment.runs_model and significant else None
    left = {one.channel: after[one.channel] for one in assessment.oversized}
    return Explained(share, left, runs, assessment.runs_model, {channel: expected[channel] for channel in left})


def assessed(
    error: Sequence[Float[np.ndarray, "k c"]],
    recordings: Sequence[Recording],
    columns: Mapping[str, str],
    sigma: Float[np.ndarray, " c"],
) -> Assessment:
    """The tests of size, whiteness and spikes of a model's simulation `error` on `recordings`, a run each, in SI.

    `columns` has the measured column of each output.
    """
    pairs = [stacked_columns([run.column(column) for run in recordings]) for column in columns.values()]
    mask = np.stack([there for _, there in pairs], axis=-1)
    whitened = np.stack([run[: mask.shape[1]] / sigma for run in error])
    return assess_residuals(tuple(columns), np.where(mask, whitened, 0.0), mask)


def expected_errors(view: View) -> dict[str, float]:
    """By channel the rms/σ that noise and a view's disturbance leave in a simulation, its initial states fitted.

    A force counts that changes within a block of a run (`BLOCKS`): what is slower is no more random in a run than
    missing physics is.
    """
    system, disturbance = view.followed.system, view.disturbance
    block = float(np.max(np.sum(np.asarray(system.intervals), axis=1))) / BLOCKS
    random = np.where(np.asarray(disturbance.time) < block, disturbance.force, 0.0)
    measured = np.asarray(system.measured)
    draws = np.random.default_rng(_SEED).standard_normal((*measured.shape[:2], len(random), _DRAWS))
    errors = open_loop_errors(dataclasses.replace(disturbance, force=random), system, draws)
    samples = np.maximum(np.sum(measured, axis=(0, 1)), 1)
    rms = np.sqrt(1.0 + np.sum(np.mean(errors**2, axis=-1), axis=(0, 1)) / samples)
    return dict(zip(view.vehicle.layout.channels, rms.tolist(), strict=True))


def consistent(judged: Judged, found: Explained, remains: Mapping[str, Remainder], assessment: Assessment) -> Judged:
    """The verdict, unless it is `none` and the test runs' error is far above what is random: then `unknown`, and why.

    `remains` is what the last model leaves of each channel there and `assessment` the tests of it, of which the one of
    size then has the mismatch's p-value.
    """
    if judged.verdict != "none":
        return judged
    # the 95 % interval of a channel's error lies far above what is random, which no `none` may leave
    over = {channel: remains[channel].low / found.random[channel] for channel in found.left}
    most = max(over.values(), default=0.0) if found.improved_runs else math.inf
    test = "low end of the test error's interval over what noise and disturbance leave"
    decision = Decision("mismatch", test, most, LARGE_ERROR, "large" if most > LARGE_ERROR else "not large")
    judged = dataclasses.replace(judged, decisions=[*judged.decisions, decision])
    if most <= LARGE_ERROR:
        return judged
    large = f"Simulation error on the test runs is {sigmas({c: found.left[c] for c in over if over[c] > LARGE_ERROR})}"
    why = large if found.improved_runs else "The model diverges on the test runs"
    note = f"{why}, although no missing effect is significant: the verdict is unknown and not none."
    p_value = judged.p_value if assessment.size is None else min(judged.p_value, assessment.size)
    return dataclasses.replace(judged, verdict="unknown", p_value=p_value, notes=[*judged.notes, note])


def sigmas(rms: Mapping[str, float]) -> str:
    """`1.4 σ in psi, 1.2 σ in r`, the largest first."""
    ranked = sorted(rms.items(), key=lambda item: -item[1])
    more = f" and more than noise in {len(ranked) - LISTED} others" if len(ranked) > LISTED else ""
    return ", ".join(f"{value:.3g} σ in {channel}" for channel, value in ranked[:LISTED]) + more
