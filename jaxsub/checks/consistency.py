"""Channels that contradict each other by kinematics alone: a factor, a sign, an axis, a delay, a drift."""

import math
from collections.abc import Mapping

import numpy as np

from ..findings import Finding
from ..recording import Recording
from ..vehicle import Layout
from .agreement import Agreement, agreement
from .relations import Motions, Relation, body_relations, mechanism_relations
from .spans import amount, of_run

_CLEAR, _SURE = 0.9, 0.95  # correlations
_FACTOR = 0.15  # by which a slope may be off 1 where every term is measured
_ROUGH = 1.5  # where one is not: by what factor
_NEAR = 0.06  # relative, of a known factor
_DRIFT = 0.3  # of the rate's rms
_SIGNIFICANT = 6.0  # standard errors
_FAR = 2.0  # rad
_STEADY = 100.0  # windows
_ANGLES = ("phi", "theta", "psi")
_TURNS = {"degrees": 180.0 / math.pi, "revolutions a minute": 30.0 / math.pi, "minutes": 60.0}
_LENGTHS = {
    "thousandths, such as mm": 1000.0, "hundredths, such as cm": 100.0, "hours": 3600.0, "km/h": 3.6,
    "feet": 1.0 / 0.3048, "knots": 1.0 / 0.5144444,
}  # fmt: skip


def consistency(recording: Recording, layout: Layout, columns: Mapping[str, np.ndarray], speed: float) -> list[Finding]:
    """What is wrong between the channels of a run, whose samples are `columns`; `speed` (m/s) where surge is locked."""
    if layout.kind == "submerged-body":
        motions = Motions(layout, columns, len(recording.times), speed)
        relations = body_relations(motions)
        angular = [relation for relation in relations if relation.channel in _ANGLES]
        swapped = _swapped_rates(recording, motions, angular)
    else:
        relations, swapped = mechanism_relations(layout, columns), []
    if swapped:
        return swapped
    findings = []
    for relation in relations:
        found = agreement(recording.times, relation.values, relation.rate)
        if found is not None and abs(found.correlation) >= _CLEAR:
            findings += _said(recording, relation, found)
        elif relation.direct and relation.exact and relation.channel in _ANGLES:
            findings += _steady(recording, relation)
    return findings


def _steady(recording: Recording, relation: Relation) -> list[Finding]:
    """A known factor or a reversed sign in a steady turn, in which the rate hardly varies and the angle goes far."""
    known = np.isfinite(relation.values) & np.isfinite(relation.rate)
    if np.count_nonzero(known) < 2:
        return []
    times, values, rate = recording.times[known], relation.values[known], relation.rate[known]
    change, integral = float(values[-1] - values[0]), float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(times)))
    if min(abs(change), abs(integral)) < 0.05 or max(abs(change), abs(integral)) < _FAR:
        return []
    ratio = change / integral
    size = max(abs(ratio), 1.0 / abs(ratio))
    reversed_alone = ratio < 0.0 and size < 1.0 + _FACTOR
    if not reversed_alone and not abs(size * math.pi / 180.0 - 1.0) < _NEAR:
        return []
    if float(np.std(rate)) > 0.5 * abs(float(np.mean(rate))):
        return []
    interval = float(np.median(np.diff(times)))
    slopes = Agreement(math.copysign(1.0, ratio), ratio, ratio, 0.0, _STEADY, 0.0, 0.0, 0.0, interval)
    return [_factor(recording, relation, slopes)]


def _said(recording: Recording, relation: Relation, found: Agreement) -> list[Finding]:
    """Findings about one relation: a wrong factor or sign alone, else a delay and a drift."""
    wrong = found.correlation < 0.0 or _off(relation, found)
    # with a delay the factor of a signal that grows or swings is not known
    if wrong and found.delay and (found.correlation < _SURE or _known(relation, found) is None):
        return []
    if wrong:
        return [_factor(recording, relation, found)]
    findings = []
    if found.delay and found.correlation > _SURE:
        late = relation.channel if found.delay > 0.0 else relation.partner
        other = f"the integral of {relation.partner}" if found.delay > 0.0 else f"the rate of {relation.channel}"
        what = f"{late} shows {amount(abs(found.delay), 's')} later what {other} shows"
        remedy = "correct the clock of one, or add an effect sensor-delay"
        findings.append(of_run("delay", "warning", recording, relation.channel, what, remedy))
    drifts = abs(found.drift) > max(_DRIFT * found.rate, _SIGNIFICANT * found.drift_error)
    if relation.direct and relation.exact and drifts:
        what = f"the rate of {relation.channel} and {relation.partner} differ by {found.drift:.2g} /s on average: drift"
        remedy = f"remove the offset of {relation.partner}, or add an effect sensor-bias"
        findings.append(of_run("drift", "warning", recording, relation.channel, what, remedy))
    return findings


def _off(relation: Relation, found: Agreement) -> bool:
    """Whether both slopes lie on one side of what the factor may be."""
    low, high = sorted((abs(found.low), abs(found.high)))
    margin = (1.0 + _FACTOR if relation.exact and abs(found.correlation) > _SURE else _ROUGH) + 4.0 * _error(found)
    return low > margin or high < 1.0 / margin


def _factor(recording: Recording, relation: Relation, found: Agreement) -> Finding:
    """The finding of a wrong factor or sign; an error where two channels that are one another's rate have it."""
    size, known = abs(found.factor), _known(relation, found)
    shown = max(size, 1.0 / size)
    rate, partner = f"the rate of {relation.channel}", relation.partner
    if shown < 1.0 + _FACTOR or not _off(relation, found):
        check, what = "sign", f"{rate} is -{amount(size)} times {partner}: sign reversed"
        remedy = f"turn the sign of {partner if relation.direct else relation.channel}"
        serious = relation.direct
    else:
        larger, smaller = (rate, partner) if size > 1.0 else (partner, rate)
        factor = f"{'-' if found.correlation < 0.0 else ''}{amount(shown)}"
        check, what = "factor", f"{larger} is {factor} times {smaller}{f': {known}?' if known else ''}"
        remedy = "check units and scale of both"
        if known and (relation.direct or size > 1.0):
            remedy = f"head the column {relation.channel if size > 1.0 else partner}[unit] with its true unit"
        serious = relation.direct and known is not None
    severity = "error" if serious and abs(found.correlation) > _SURE else "warning"
    return of_run(check, severity, recording, relation.channel, what, remedy)


def _known(relation: Relation, found: Agreement) -> str | None:
    """What a factor, or one over it, stands for between units."""
    shown = max(abs(found.factor), 1.0 / max(abs(found.factor), 1e-300))
    near = _NEAR + 2.0 * _error(found)
    units = _TURNS if relation.channel in _ANGLES else _TURNS | _LENGTHS
    return next((name for name, factor in units.items() if abs(shown / factor - 1.0) < near), None)


def _error(found: Agreement) -> float:
    """The relative standard error of a slope, which few windows or noisy ones leave."""
    return math.sqrt(max(1.0 - found.correlation**2, 0.0) / found.windows)


def _swapped_rates(recording: Recording, motions: Motions, relations: list[Relation]) -> list[Finding]:
    """Findings where two angles follow each other's rates and not their own."""
    follows = {}
    for relation in relations:
        for rate in ("p", "q", "r"):
            values = motions.measured(rate)
            found = None if values is None else agreement(recording.times, relation.values, values)
            follows[relation.channel, rate] = 0.0 if found is None or found.delay else abs(found.correlation)
    own = {relation.channel: relation.partner for relation in relations if relation.partner in ("p", "q", "r")}
    findings = []
    for channel, rate in own.items():
        for other, theirs in own.items():
            if channel < other and all(
                follows[a, b] > _CLEAR and follows[a, c] < 0.7
                for a, b, c in ((channel, theirs, rate), (other, rate, theirs))
            ):
                what = f"{channel} follows {theirs}, and {other} follows {rate}: {rate} and {theirs} swapped?"
                findings.append(of_run("axis", "error", recording, channel, what, "swap the headers of both"))
    return findings
