"""What the evidence amounts to: none, named, ambiguous or unknown."""

import dataclasses
import math
from collections.abc import Sequence

from ..effects import AbstractEffect
from ..plain import finite_text
from .diagnosis import Verdict
from .generic import Pattern
from .name import Named, Naming
from .show import Luck
from .whiteness import Memory

CERTAIN = 0.9
# of a mismatch, the share that its cause explains
EXPLAINED = 0.75
# log evidence by which a force without a name must beat the names to stand instead of them
_CLEARLY = 3.0
_BEYOND_DOUBT = 1e-6


@dataclasses.dataclass(frozen=True)
class Judged:
    """A verdict, the effects that stand, the mismatch's p-value, notes for the reader."""

    verdict: Verdict
    named: list[Named]
    p_value: float
    notes: list[str]


NOTHING = Judged("none", [], 1.0, [])


def both(earlier: Judged, later: Judged) -> Judged:
    """What is to be said once a model with what stands of `earlier` was looked at again, or others were asked."""
    named, notes = [*earlier.named, *later.named], [*earlier.notes, *later.notes]
    missed: Verdict = "unknown" if earlier.verdict == "unknown" else later.verdict
    verdict = _certainty(named) if named else missed
    return Judged(verdict, named, min(earlier.p_value, later.p_value), notes)


def judge(naming: Naming, pattern: Pattern | None, memory: Memory) -> Judged:
    """The verdict before anything was tried on the held-out runs."""
    follows = pattern is not None and pattern.significant
    # a scan that no choice followed was either not significant or predicted nothing
    least = naming.first_p if naming.named or pattern is None or not follows else min(naming.first_p, pattern.p_value)
    p_value: float = min(1.0, 2.0 * least)
    notes: list[str] = []
    if pattern is not None and follows:
        notes.append(f"{pattern.force.expression} is asked for in {pattern.force.equation}: {pattern.described}.")
    if memory.correlated:
        chance = f"that its samples are so correlated by chance has p = {memory.p_value:.2g}"
        notes.append(f"What is left is not random: {chance}.")
    if not naming.named and memory.correlated and not follows:
        return Judged("unknown", [], min(p_value, memory.p_value), notes)
    if not naming.named:
        return Judged("unknown" if follows else "none", [], p_value, notes)
    labels = ", ".join(named.effect.label for named in naming.named)
    if pattern is not None and follows and pattern.alone > naming.value + _CLEARLY:
        notes.append(f"{labels} is the best of the vocabulary, and says less than a force without a name.")
        return Judged("unknown", [], p_value, notes)
    if pattern is not None and follows and pattern.explained < EXPLAINED:
        notes.append(f"{labels} would explain {pattern.explained:.0%} of the mismatch, too little for its cause.")
        return Judged("unknown", [], p_value, notes)
    if memory.correlated and memory.explained < EXPLAINED:
        notes.append(
            f"{labels} would explain {memory.explained:.0%} of it and of what is left, too little for its cause."
        )
        return Judged("unknown", [], p_value, notes)
    return Judged(_certainty(naming.named), naming.named, p_value, notes)


def helped(judged: Judged, effect: AbstractEffect, gain: Luck) -> Judged:
    """The verdict once it is known what held-out runs gain by an effect."""
    return dataclasses.replace(judged, notes=[*judged.notes, _gain_said(effect.label, gain)])


def _gain_said(label: str, gain: Luck) -> str:
    if gain.helps and gain.freely:
        left = finite_text(gain.free, ".0%")
        start = f"With {label} free runs through the held-out runs leave {left} of their squared errors; "
        return start + f"that this is luck has probability {gain.free_probability:.2g}."
    if gain.helps and not math.isfinite(gain.likelihood):
        return f"Without {label} the model diverges along the held-out runs."
    if gain.helps:
        start = f"With {label} the held-out runs gain {gain.likelihood:.4g} in log likelihood; "
        return start + f"that this is luck has probability {gain.probability:.2g}."
    worse = "the held-out runs worse"
    why = worse if gain.sound else "with numbers that physics does not admit or the runs do not tell"
    return f"{label} fitted the training runs better but {why}, and is not accepted."


def by_fit(judged: Judged, share: float) -> Judged:
    """The verdict on names that said too little by a linear picture, with the share of it that their fit explains."""
    labels = ", ".join(one.effect.label for one in judged.named)
    return dataclasses.replace(judged, notes=[*judged.notes, f"Fitted, {labels} explains {share:.0%} of it."])


def standing_in(judged: Judged, effects: Sequence[AbstractEffect]) -> Judged:
    """The verdict with a word on effects that are in the model and were not named."""
    labels = ", ".join(effect.label for effect in effects)
    note = f"Free runs through the held-out runs err less with {labels}, standing in for what has no name."
    return dataclasses.replace(judged, notes=[*judged.notes, note])


def by_all(judged: Judged, pieces: int) -> Judged:
    """The verdict on many effects found by what comes next, which free runs bear out, each run cut into `pieces`."""
    note = "Free runs through the held-out runs, which alone asked for something else, err less with all of these."
    if pieces > 1:
        note += f" The model does not run free for long: free runs are begun anew in each of {pieces} parts of a run."
    return dataclasses.replace(judged, notes=[*judged.notes, note])


def idle(judged: Judged, label: str, others: Sequence[str]) -> Judged:
    """The verdict less an effect that is not asked for any more beside `others`."""
    named = [one for one in judged.named if one.effect.label != label]
    note = f"Beside {', '.join(others)} the held-out runs ask for {label} no more, and it is left out."
    return dataclasses.replace(judged, verdict=_certainty(named), named=named, notes=[*judged.notes, note])


def settled(judged: Judged, stand: list[Named]) -> Judged:
    """The verdict once everything was tried: named by what stands.

    Where nothing does, a mismatch that is beyond doubt is unknown, and any other was luck.
    """
    if stand:
        return dataclasses.replace(judged, named=stand, verdict=_certainty(stand))
    if not judged.named:
        return judged
    return dataclasses.replace(judged, verdict="unknown" if judged.p_value < _BEYOND_DOUBT else "none", named=[])


def _certainty(named: Sequence[Named]) -> Verdict:
    return "named" if all(one.probability >= CERTAIN for one in named) else "ambiguous"
