"""What the recordings ask for, tried and asked again until what is left is random, refused or without a name."""

import dataclasses
from collections.abc import Callable, Generator, Sequence

from ..effects import AbstractEffect
from ..errors import InputError
from ..results import RESULTS
from .acceptance import Examination, Model, ModelFitter, accept_proposed, proposed_effects
from .cross_validation import compare
from .evidence import evidence_of
from .examine import examine, weighed
from .many import by_what_comes_next
from .name import standing
from .progress import OutOfTime
from .settings import EXPLAINED, MAJORITY, MOST_EFFECTS, MOST_REJECTIONS
from .verdict import NOTHING, Judged, both, by_fit, helped, idle, incomplete, judge, settled
from .whiteness import share_of

# a model, what is to be said with it, and the last look at what it leaves, if anything may be left
Answer = tuple[Model, Judged, Examination | None]


def explained(
    fitter: ModelFitter,
    baseline: Model,
    found: Examination,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
    keep: Callable[[Model, Judged], object] = lambda model, judged: None,
    begin: Sequence[AbstractEffect] = (),
) -> Answer:
    """The model with what can be named, as `answers` ends; the answer so far where it is ended before.

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
    """The answer so far after each round of proposals that accepts something; returns the one to be given.

    With effects to `begin` with, which an earlier answer had, the first round is theirs.

    Everything is looked at again from a model with what stands, where a free run asked for it, others fell, or what
    they leave is not random: far from the truth a linear picture shows the largest alone. Where the baseline does not
    run free, and where all that was named is rejected, what comes next is asked, once; and where the
    mismatch is then beyond doubt still, the rest of the vocabulary.
    """
    best, judged, refusals = baseline, NOTHING, 0
    dropped: set[str] = set()
    # a free run that cannot be fitted asks for nothing
    told_ahead = bool(baseline.fit.result != RESULTS.successful)
    ahead = by_what_comes_next(fitter, baseline, vocabulary) if told_ahead else None
    if ahead is not None:
        return *ahead, None
    if begin:
        best, judged = begun(fitter, baseline, found, begin)
        if judged.named:
            yield best, judged
            found = examine(best.view, vocabulary, fitter.progress)
    while True:
        said, after = judge(found.naming, found.pattern, found.memory), None
        chosen = proposed_effects(found, said)
        # what was left out once and is asked for again stays: it would come and go
        older = [effect for effect in best.added if effect.label not in dropped]
        if chosen:
            best, said = accept_proposed(fitter, best, found, chosen, said)
        else:
            best, said, after = after_all(fitter, best, found, said, vocabulary)
        judged = both(judged, said)
        if chosen and said.named:
            best, judged = without_idle(fitter, baseline, best, judged, older)
            dropped |= {effect.label for effect in older} - {effect.label for effect in best.added}
        if chosen and not said.named:
            ahead = None if told_ahead else by_what_comes_next(fitter, best, vocabulary)
            if ahead is not None:
                return ahead[0], both(judged, ahead[1]), None
            told_ahead = True
            if said.verdict == "unknown" and refusals < MOST_REJECTIONS:
                refusals, after = refusals + 1, weighed(found.view, found.selector, fitter.progress)
        if after is None and not said.named:
            return best, judged, found
        whole = len(said.named) == len(found.naming.named) and not (found.naming.again or found.unexplained)
        if (after is None and whole) or len(best.added) >= MOST_EFFECTS:
            return best, judged, None
        if said.named:
            yield best, judged
        found = after or examine(best.view, vocabulary, fitter.progress)


def begun(
    fitter: ModelFitter, baseline: Model, found: Examination, effects: Sequence[AbstractEffect]
) -> tuple[Model, Judged]:
    """The model with the `effects` of an earlier answer, if they are accepted together, and what is to be said.

    Probabilities are those of the first look. **Raises** `InputError` for an effect that is not among its candidates.
    """
    selector, labels = found.selector, [effect.label for effect in effects]
    numbers = []
    for label in labels:
        own = [i for i, candidate in enumerate(selector.candidates) if candidate.label == label]
        if not own:
            what = f"{label} is not among the effects that these recordings may ask for"
            raise InputError(fitter.file.layout.name, what, "begin without it")
        numbers.append(max(own, key=lambda i: found.naming.first.value[i]))
    model = fitter.with_effects(baseline, effects, found.naming.products.disturbance)
    gain = compare(baseline.predicted, model.predicted, model.significant)
    named = standing(selector, numbers) if gain.accepted else []
    judged = dataclasses.replace(NOTHING, p_value=min(1.0, 2.0 * found.naming.first_p))
    return (model if gain.accepted else baseline), settled(helped(judged, ", ".join(labels), gain), named)


def without_idle(
    fitter: ModelFitter, baseline: Model, best: Model, judged: Judged, older: Sequence[AbstractEffect]
) -> tuple[Model, Judged]:
    """The model less those `older` effects that are not accepted any more, and what is then to be said.

    What was added first may have stood in for what came after it.
    """
    for effect in older:
        others = [e.label for e in best.added if e.label != effect.label]
        fewer = fitter.with_effects(
            baseline, [e for e in best.fit.vehicle.effects if e.label in others], best.view.disturbance
        )
        comparison = compare(fewer.predicted, best.predicted)
        if not comparison.accepted and fewer.significant:
            best, judged = fewer, idle(judged, effect.label, others, comparison)
    return best, judged


def after_all(
    fitter: ModelFitter,
    base: Model,
    found: Examination,
    judged: Judged,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, Judged, Examination | None]:
    """The model with names that seemed to say too little, what is to be said, and what is found from there.

    A name that a force without one seemed to beat, if it is of the same equation and its fit leaves no such force:
    where a motion is no larger than its noise, a linear picture along it gives the wrong shape to a force of a rate,
    which nothing then seems to have. Names that seemed to explain most and too little for the cause, if their fit does
    not: of what is large a linear picture leaves much, which is no disturbance. Else all is as it was.
    """
    most = found.nonparametric is None and found.memory.correlated and found.memory.explained > MAJORITY
    named = found.naming.named
    here = [one.number for one in (named if most else [o for o in named if found.nonparametric in o.effect.where][:1])]
    best, said = accept_proposed(fitter, base, found, here, judged) if here else (base, judged)
    if not said.named:
        return base, judged, None
    more = examine(best.view, vocabulary, fitter.progress)
    share = _explained(base, best, more)
    stands = more.nonparametric is None and share >= EXPLAINED if most else more.nonparametric != found.nonparametric
    return (best, by_fit(said, share) if most else said, more) if stands else (base, judged, None)


def _explained(base: Model, best: Model, found: Examination) -> float:
    """Of what a fit explains and of what the past tells beside it, as `found` from there, the fit's share."""
    gain = 2.0 * (evidence_of(best.view) - evidence_of(base.view))
    return share_of(gain, found.memory.told if found.memory.correlated else 0.0)
