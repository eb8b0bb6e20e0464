"""The verdict by all decisions: none, named, ambiguous or unknown."""

import dataclasses
import math
from collections.abc import Sequence

from ...effects import AbstractEffect
from .. import settings
from ..linearise.whiteness import Memory
from ..propose.name import Named, Naming
from ..propose.nonparametric import Pattern
from ..records.decisions import Decision
from ..records.diagnosis import Verdict
from .cross_validation import Comparison, Gain


@dataclasses.dataclass(frozen=True)
class Judged:
    """A verdict, the accepted effects, the mismatch's p-value, notes for the reader, and every decision in order.

    It is not `complete` where time ran out before all was tried.
    """

    verdict: Verdict
    named: list[Named]
    p_value: float
    notes: list[str]
    decisions: list[Decision] = dataclasses.field(default_factory=list)
    complete: bool = True


NOTHING = Judged("none", [], 1.0, [])


def combined(earlier: Judged, later: Judged) -> Judged:
    """The judgement of two rounds, the later one with the accepted effects of the earlier in its model."""
    named, notes = [*earlier.named, *later.named], [*earlier.notes, *later.notes]
    missed: Verdict = "unknown" if earlier.verdict == "unknown" else later.verdict
    verdict = _certainty(named) if named else missed
    decisions = [*earlier.decisions, *later.decisions]
    return Judged(verdict, named, min(earlier.p_value, later.p_value), notes, decisions)


def judge(naming: Naming, pattern: Pattern | None, memory: Memory) -> Judged:
    """The verdict before anything was fitted."""
    follows = pattern is not None and pattern.significant
    # a scan that no selection followed was either not significant or predicted nothing
    least = naming.first_p if naming.named or pattern is None or not follows else min(naming.first_p, pattern.p_value)
    p_value: float = min(1.0, 2.0 * least)
    labels = ", ".join(named.effect.label for named in naming.named)
    decisions, notes = _tests(labels, naming, pattern, memory), []
    if pattern is not None and follows:
        where = f"in {pattern.force.equation}: {pattern.described}"
        notes.append(f"A nonparametric force {pattern.force.expression} is significant {where}.")
    if memory.correlated:
        notes.append(f"What is left is correlated in time (p = {memory.p_value:.2g} if it were white).")
    if not naming.named:
        p_value = min(p_value, memory.p_value) if memory.correlated and not follows else p_value
        return Judged("unknown" if follows or memory.correlated else "none", [], p_value, notes, decisions)
    doubts = _doubts(labels, naming, pattern if follows else None, memory)
    decisions += [decision for decision, _ in doubts]
    doubted = next((note for decision, note in doubts if decision.outcome == "rejected"), None)
    if doubted is not None:
        return Judged("unknown", [], p_value, [*notes, doubted], decisions)
    return Judged(_certainty(naming.named), naming.named, p_value, notes, decisions)


def _tests(labels: str, naming: Naming, pattern: Pattern | None, memory: Memory) -> list[Decision]:
    """The tests of one examination."""
    choice = "proposed" if naming.named else "not proposed"
    score = "p-value of the largest score, corrected for all candidates"
    decisions = [Decision(labels or "mismatch", score, naming.first_p, settings.SIGNIFICANCE, choice)]
    if pattern is not None:
        outcome = "significant" if pattern.significant else "not significant"
        test = "p-value of a nonparametric force, corrected for all tried"
        decisions.append(Decision(pattern.force.label, test, pattern.p_value, settings.SIGNIFICANCE, outcome))
    outcome = "correlated" if memory.correlated else "white"
    test = "p-value of white innovations"
    return [*decisions, Decision("mismatch", test, memory.p_value, settings.RESIDUAL_LEVEL, outcome)]


def _doubts(labels: str, naming: Naming, pattern: Pattern | None, memory: Memory) -> list[tuple[Decision, str]]:
    """Whether names explain too little of the mismatch beside a significant `pattern` or correlated innovations."""
    doubts = []

    def tested(test: str, statistic: float, threshold: float, rejected: bool, note: str) -> None:
        doubts.append((Decision(labels, test, statistic, threshold, "rejected" if rejected else "kept"), note))

    if pattern is not None:
        lead = pattern.alone - naming.value
        note = f"{labels} has the highest evidence in the vocabulary, and less than a nonparametric force alone."
        test, clear = "log evidence of a nonparametric force over theirs", settings.CLEAR_LOG_BAYES
        tested(test, lead, clear, lead > clear, note)
    shares = {"a nonparametric force": pattern.explained} if pattern is not None else {}
    shares |= {"correlated innovations": memory.explained} if memory.correlated else {}
    for beside, share in shares.items():
        note = f"{labels} would explain {share:.0%} of the mismatch beside {beside}, too little for its cause."
        tested(f"share explained beside {beside}", share, settings.EXPLAINED, share < settings.EXPLAINED, note)
    return doubts


def with_gain(judged: Judged, label: str, gain: Comparison) -> Judged:
    """The verdict once it is known what is gained by an effect, or by several, of a `label`."""
    notes, decisions = [*judged.notes, _sentence(label, gain)], _decisions(label, gain)
    return dataclasses.replace(judged, notes=notes, decisions=[*judged.decisions, *decisions])


def _decisions(label: str, gain: Comparison) -> list[Decision]:
    """A record for each horizon of a comparison."""
    outcome = "accepted" if gain.accepted else "rejected"
    horizons = {"one step ahead": gain.one_step, "simulation": gain.simulation}
    test = "p-value of the gain in cross-validated log predictive density"
    level = settings.SIGNIFICANCE
    decisions = [Decision(label, f"{test}, {name}", one.better, level, outcome) for name, one in horizons.items()]
    if gain.unlikelier:
        test = "gain in cross-validated log predictive density, one step ahead"
        decisions.append(Decision(label, test, gain.one_step.total, -settings.CLEAR_LOG_BAYES, outcome))
    if not gain.admissible:
        decisions.append(Decision(label, "admissible and significant numbers", 0.0, 1.0, outcome))
    return decisions


def _sentence(label: str, gain: Comparison) -> str:
    if not gain.admissible:
        return f"{label} is rejected: its fitted numbers are not physically admissible, or not significant."
    gains = " and ".join(
        _horizon(*pair) for pair in (("one step ahead", gain.one_step), ("in simulation", gain.simulation))
    )
    return f"{label} is {'accepted' if gain.accepted else 'rejected'}: blocks of the training runs {gains}."


def _horizon(name: str, gain: Gain) -> str:
    if not math.isfinite(gain.total):
        return f"diverge {'without' if gain.total > 0.0 else 'with'} it {name}"
    size = f"{abs(gain.total):.4g} in log predictive density"
    return f"{'lose' if gain.total < 0.0 else 'gain'} {size} {name} (p = {gain.better:.2g})"


def incomplete(judged: Judged) -> Judged:
    """The verdict so far, of a diagnosis that is ended, or not at its end."""
    on = "before more candidates were tried; --begin improved.toml goes on from it"
    tried = on if judged.named else "before any effect was accepted"
    note = f"This answer is incomplete: it is the one so far, {tried}."
    return dataclasses.replace(judged, notes=[*judged.notes, note], complete=False)


def by_fit(judged: Judged, share: float) -> Judged:
    """The verdict on effects whose fit explains more than the linearisation did, with that share."""
    labels = ", ".join(one.effect.label for one in judged.named)
    return dataclasses.replace(judged, notes=[*judged.notes, f"Fitted, {labels} explains {share:.0%} of it."])


def with_surrogate_note(judged: Judged, effects: Sequence[AbstractEffect]) -> Judged:
    """The verdict with a note on surrogate terms in the model."""
    labels = ", ".join(effect.label for effect in effects)
    note = f"Simulation errors are smaller with {labels}, a surrogate for unknown physics."
    return dataclasses.replace(judged, notes=[*judged.notes, note])


def found_by_innovations(judged: Judged, pieces: int) -> Judged:
    """The verdict on effects found by innovations and accepted in simulation, re-initialised in `pieces` of a run."""
    note = "These effects were found by innovations, and are accepted together by the simulation error."
    if pieces > 1:
        note += f" The model cannot be simulated for long: simulation starts anew in each of {pieces} parts of a run."
    return dataclasses.replace(judged, notes=[*judged.notes, note])


def without_effect(judged: Judged, label: str, others: Sequence[str], gain: Comparison) -> Judged:
    """The verdict less an effect that is not accepted any more beside `others`."""
    named = [one for one in judged.named if one.effect.label != label]
    judged = dataclasses.replace(judged, decisions=[*judged.decisions, *_decisions(label, gain)])
    note = f"Beside {', '.join(others)} {label} is not accepted any more, and it is left out."
    return dataclasses.replace(judged, verdict=_certainty(named), named=named, notes=[*judged.notes, note])


def replacing(judged: Judged, label: str, gain: Comparison, p_value: float, outcome: str) -> Judged:
    """The judgement on coefficients of the baseline beside effects that replace them, all in the `label`.

    By what is gained with the coefficients, and the largest `p_value` of an effect without them.
    """
    own = Decision(label, "largest p-value of an effect without them", p_value, settings.SIGNIFICANCE, outcome)
    return dataclasses.replace(judged, decisions=[*judged.decisions, *_decisions(label, gain), own])


def concluded(judged: Judged, stand: list[Named]) -> Judged:
    """The verdict once everything was tried: named by the accepted effects.

    Where none is accepted, a significant mismatch is unknown, and any other is none.
    """
    if stand:
        return dataclasses.replace(judged, named=stand, verdict=_certainty(stand))
    if not judged.named:
        return judged
    missed: Verdict = "unknown" if judged.p_value < settings.UNEXPLAINED_LEVEL else "none"
    return dataclasses.replace(judged, verdict=missed, named=[])


def _certainty(named: Sequence[Named]) -> Verdict:
    return "named" if all(one.probability >= settings.CERTAIN for one in named) else "ambiguous"
