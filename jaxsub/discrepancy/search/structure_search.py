"""The structure search: effects are proposed, fitted and accepted until none is left that is."""

import dataclasses
from collections.abc import Callable, Generator, Sequence

from ...effects import AbstractEffect
from ...errors import InputError
from ...estimate import evaluate
from .. import settings
from ..accept.acceptance import Examination, Model, ModelFitter, accept_proposed, proposed_effects
from ..accept.cross_validation import compare
from ..accept.verdict import NOTHING, Judged, by_fit, combined, concluded, incomplete, judge, with_gain, without_effect
from ..linearise.evidence import evidence_of
from ..linearise.whiteness import share_of
from ..propose.name import with_probabilities
from ..records.progress import OutOfTime
from .examine import examine, weighed
from .replacement import with_replacement
from .stepwise import stepwise_by_innovations

# a model, the judgement with it, and the examination of what it leaves, if anything may be left
Answer = tuple[Model, Judged, Examination | None]


def search_structure(
    fitter: ModelFitter,
    baseline: Model,
    found: Examination,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
    keep: Callable[[Model, Judged], object] = lambda model, judged: None,
    begin: Sequence[AbstractEffect] = (),
) -> Answer:
    """The model with all accepted effects, as `answers` ends; the answer so far where time runs out.

    Each answer before the last is given to `keep`.
    """
    rounds = answers(fitter, baseline, found, vocabulary, begin)
    last: tuple[Model, Judged] | None = None
    try:
        while True:
            last = best, judged = next(rounds)
            keep(best, incomplete(judged))
    except StopIteration as end:
        return end.value
    except OutOfTime:
        best, judged = last or (baseline, Judged("unknown", [], min(1.0, 2.0 * found.naming.first_p), []))
        return best, incomplete(judged), None


def answers(
    fitter: ModelFitter,
    baseline: Model,
    found: Examination,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
    begin: Sequence[AbstractEffect] = (),
) -> Generator[tuple[Model, Judged], None, Answer]:
    """The answer so far after each round that accepts an effect; returns the last one.

    With effects to `begin` with, which an earlier answer had, the first round is theirs.

    After each acceptance all candidates are examined again from the new model: far from the truth, the linearisation
    shows only the largest effect. Coefficients of the baseline that it replaces are left out. Where the baseline cannot
    be simulated, and where all proposals are rejected, stepwise selection by innovations is tried, once. What it
    accepts is the last answer where simulation follows in parts of runs alone. Where the mismatch is significant still,
    the remaining candidates are proposed.
    """
    best, judged, refusals = baseline, NOTHING, 0
    dropped: set[str] = set()
    # a simulation that cannot be fitted proposes nothing
    searched = not evaluate(baseline.fit).at_optimum
    by_innovations = stepwise_by_innovations(fitter, baseline, vocabulary) if searched else None
    if begin and by_innovations is None:
        best, judged = warm_started(fitter, baseline, found, begin)
        if judged.named:
            best, judged = with_replacement(fitter.progress, best, judged)
            yield best, judged
            found = examine(best.view, vocabulary, fitter.progress)
    while True:
        if by_innovations is not None:
            best, judged = by_innovations[0], combined(judged, by_innovations[1])
            if best.pieces > 1:
                return best, judged, None
            yield best, judged
            found, by_innovations = examine(best.view, vocabulary, fitter.progress), None
        current, after = judge(found.naming, found.pattern, found.memory), None
        chosen = proposed_effects(found, current)
        # an effect dropped once and proposed again stays, or the search would cycle
        older = [effect for effect in best.added if effect.label not in dropped]
        if chosen:
            best, current = accept_proposed(fitter, best, found, chosen, current)
        else:
            best, current, after = reconsidered(fitter, best, found, current, vocabulary)
        judged = combined(judged, current)
        if chosen and current.named:
            best, judged = without_redundant(fitter, baseline, best, judged, older)
            dropped |= {effect.label for effect in older} - {effect.label for effect in best.added}
        if current.named:
            best, judged = with_replacement(fitter.progress, best, judged)
        if chosen and not current.named:
            by_innovations = None if searched else stepwise_by_innovations(fitter, best, vocabulary)
            searched = True
            if by_innovations is not None:
                continue
            if current.verdict == "unknown" and refusals < settings.ALTERNATIVES:
                refusals, after = refusals + 1, weighed(found.view, found.selector, fitter.progress)
        if after is None and not current.named:
            return best, judged, found
        whole = len(current.named) == len(found.naming.named) and not found.unexplained
        if (after is None and whole) or len(best.added) >= settings.MOST_EFFECTS:
            return best, judged, None
        if current.named:
            yield best, judged
        found = after or examine(best.view, vocabulary, fitter.progress)


def warm_started(
    fitter: ModelFitter, baseline: Model, found: Examination, effects: Sequence[AbstractEffect]
) -> tuple[Model, Judged]:
    """The model with the `effects` of an earlier answer, if they are accepted together, and the judgement.

    Posterior probabilities are those of the first examination. **Raises** `InputError` for an effect that is not among
    its candidates.
    """
    selector, labels = found.selector, [effect.label for effect in effects]
    numbers = []
    for label in labels:
        own = [i for i, candidate in enumerate(selector.candidates) if candidate.label == label]
        if not own:
            what = f"{label} is no candidate for these recordings"
            raise InputError(fitter.file.layout.name, what, "begin without it")
        numbers.append(max(own, key=lambda i: found.naming.first.value[i]))
    model = fitter.with_effects(baseline, effects, found.naming.products.disturbance)
    gain = compare(baseline.predicted, model.predicted, model.significant)
    named = with_probabilities(selector, numbers) if gain.accepted else []
    judged = dataclasses.replace(NOTHING, p_value=min(1.0, 2.0 * found.naming.first_p))
    return (model if gain.accepted else baseline), concluded(with_gain(judged, ", ".join(labels), gain), named)


def without_redundant(
    fitter: ModelFitter, baseline: Model, best: Model, judged: Judged, older: Sequence[AbstractEffect]
) -> tuple[Model, Judged]:
    """The model less those `older` effects that are no longer accepted beside the newer ones, and the judgement.

    An effect added first may have been a surrogate of one added later.
    """
    for effect in older:
        others = [e.label for e in best.added if e.label != effect.label]
        fewer = fitter.with_effects(
            baseline, [e for e in best.fit.vehicle.all_effects if e.label in others], best.view.disturbance
        )
        stands = best.p_value_of(effect) < settings.SIGNIFICANCE
        comparison = compare(fewer.predicted, best.predicted, stands)
        if not comparison.accepted and fewer.significant:
            best, judged = fewer, without_effect(judged, effect.label, others, comparison)
    return best, judged


def reconsidered(
    fitter: ModelFitter,
    base: Model,
    found: Examination,
    judged: Judged,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, Judged, Examination | None]:
    """The model with effects that the linearisation rejected, where their fit says otherwise.

    With the judgement and the examination from there; unchanged, without examination, where the fit agrees. That is an
    effect which a nonparametric force in the same equation seemed to beat, if its fit leaves no such force: where a
    motion is no larger than its noise, the filtered trajectory distorts the shape of a force. Or effects that seemed to
    explain most but too little for the cause, if their fit explains enough: a large effect has a large linearisation
    error.
    """
    most = found.nonparametric is None and found.memory.correlated and found.memory.explained > settings.MAJORITY
    named = found.naming.named
    here = [one.number for one in (named if most else [o for o in named if found.nonparametric in o.effect.where][:1])]
    best, current = accept_proposed(fitter, base, found, here, judged) if here else (base, judged)
    if not current.named:
        return base, judged, None
    more = examine(best.view, vocabulary, fitter.progress)
    share = _explained(base, best, more)
    enough = more.nonparametric is None and share >= settings.EXPLAINED
    stands = enough if most else more.nonparametric != found.nonparametric
    return (best, by_fit(current, share) if most else current, more) if stands else (base, judged, None)


def _explained(base: Model, best: Model, found: Examination) -> float:
    """The share of a fit's gain in the sum of it and of what correlated innovations still explain."""
    gain = 2.0 * (evidence_of(best.view) - evidence_of(base.view))
    return share_of(gain, found.memory.gain if found.memory.correlated else 0.0)
