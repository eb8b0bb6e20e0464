"""Findings about channels that contradict each other by kinematics."""

import numpy as np

from ..findings import Finding
from ..recording import Recording
from .increments import Comparison
from .mends import Mend, is_angular, known_factor
from .relations import Relation
from .spans import amount, of_run

_SURE = 0.15  # distance that a mend leaves, up to which a fault of two channels alone is an error
UNLIKE = 0.6  # distance of sides that have little in common
_STILL = 10.0  # times the changes of the other side
_NEAR = 0.06  # relative, of a known factor


def explanation(recording: Recording, mend: Mend, relation: Relation, left: float) -> Finding:
    """The finding of a fault that shows most in `relation`, whose sides are `left` apart without it."""
    if mend.kind in ("delay", "clock"):
        return _late(recording, mend, relation)
    if mend.kind == "drift":
        what = (
            f"the rate of {relation.channel} and {relation.partner} differ by {-mend.amount:.2g} /s on average: drift"
        )
        remedy = f"remove the offset of {relation.partner}, or add an effect sensor-bias"
        return of_run("drift", "warning", recording, relation.channel, what, remedy)
    if mend.kind == "axis":
        one, other = mend.channels
        what = f"{one} and {other} swapped: the rate of {relation.channel} agrees with {relation.partner} only so"
        severity = "error" if relation.direct and left < _SURE else "warning"
        return of_run("axis", severity, recording, relation.channel, what, f"swap the headers of {one} and {other}")
    if relation.direct and set(mend.channels) <= {relation.channel, relation.partner}:
        return _of_pair(recording, mend, relation, left)
    (name,) = mend.channels
    agrees = f"the rate of {relation.channel} agrees with {relation.partner} only"
    if mend.kind == "sign" or abs(abs(mend.amount) - 1.0) < 0.15:
        what, remedy = f"{agrees} with -{name}: sign reversed", f"turn the sign of {name}"
        return of_run("sign", "warning", recording, name, what, remedy)
    known = known_factor(is_angular(name), mend.amount, _NEAR + left)
    what = f"{agrees} with {name} {_times(1.0 / mend.amount)}{f': {known}?' if known else ''}"
    remedy = f"head the column {name}[unit] with its true unit" if known else f"check unit and scale of {name}"
    return of_run("factor", "warning", recording, name, what, remedy)


def contradiction(recording: Recording, relation: Relation, found: Comparison) -> Finding:
    """The finding of sides that have little in common, for which no single fault accounts."""
    ratio = float(np.nanmedian(found.integrals / np.maximum(found.changes, 1e-300)))
    what = f"the rate of {relation.channel} and {relation.partner} have little in common: distance "
    what += f"{float(np.nanmin(found.distances)):.2g} (0 where equal, limit {UNLIKE})"
    if max(ratio, 1.0 / max(ratio, 1e-9)) > _STILL:
        sides = (relation.partner, relation.channel)
        still, moving = sides if ratio < 1.0 else sides[::-1]
        what += f"; {still} hardly moves while {moving} does"
    return of_run(
        "contradiction", "warning", recording, relation.channel, what, "see whether one of their sensors was off"
    )


def _of_pair(recording: Recording, mend: Mend, relation: Relation, left: float) -> Finding:
    """The finding of a wrong factor or sign between a channel and the one that is its rate."""
    rate, partner = f"the rate of {relation.channel}", relation.partner
    # how many times the partner the rate is
    ratio = -1.0 if mend.kind == "sign" else mend.amount if mend.channels == (relation.channel,) else 1.0 / mend.amount
    size = abs(ratio)
    shown = max(size, 1.0 / size)
    if shown < 1.15:
        what = f"{rate} is -{amount(size)} times {partner}: sign reversed"
        severity = "error" if left < _SURE else "warning"
        return of_run("sign", severity, recording, relation.channel, what, f"turn the sign of {partner}")
    known = known_factor(is_angular(relation.channel), ratio, _NEAR + left)
    larger, smaller = (rate, partner) if size > 1.0 else (partner, rate)
    factor = f"{'-' if ratio < 0.0 else ''}{amount(shown)}"
    what = f"{larger} is {factor} times {smaller}{f': {known}?' if known else ''}"
    remedy = "check units and scale of both"
    if known:
        remedy = f"head the column {relation.channel if size > 1.0 else partner}[unit] with its true unit"
    severity = "error" if known and left < _SURE else "warning"
    return of_run("factor", severity, recording, relation.channel, what, remedy)


def _late(recording: Recording, mend: Mend, relation: Relation) -> Finding:
    names = ", ".join(mend.channels)
    show = "shows" if len(mend.channels) == 1 else "show"
    is_rate = relation.channel not in mend.channels
    other = f"the rate of {relation.channel}" if is_rate else f"the integral of {relation.partner}"
    if mend.kind == "delay":
        what = f"{names} {show} {amount(mend.amount, 's')} later what {other} shows"
        remedy = "correct the clock of one, or add an effect sensor-delay"
        return of_run("delay", "warning", recording, mend.channels[0], what, remedy)
    course = "slow" if mend.amount > 0.0 else "fast"
    share = abs(mend.amount) / recording.duration
    what = (
        f"the clock of {names} is {amount(abs(mend.amount), 's')} {'late' if mend.amount > 0.0 else 'early'} at the"
        f" end of the run against {other}: it runs {100.0 * share:.2g} % {course}"
    )
    return of_run("clock", "warning", recording, mend.channels[0], what, "synchronise the clocks of both sensors")


def _times(factor: float) -> str:
    return f"times {amount(factor)}" if abs(factor) > 1.0 else f"divided by {amount(1.0 / factor)}"
