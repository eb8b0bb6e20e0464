"""Many effects that are missing at once, one look after the other, by what comes next.

A free run that errs for many causes asks for what does what all of these do. So innovations are asked what is missing
and how large it is, until they ask for nothing more that predicts the held-out runs; and free runs then judge it all.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..effects import AbstractEffect
from .ahead import Ahead, proved
from .examine import listed, weighed
from .model import p_value
from .name import Named, refitted
from .selector import SIGNIFICANCE
from .show import Luck, luck
from .trial import Model, Trial, Tries, borne_out, refitted_all, worth_trying
from .verdict import CERTAIN, NOTHING, Judged, both, by_all, helped, judge, settled

# effects beyond which no more are sought, and sets that may be refused
_MANY, _REFUSALS = 16, 2
# rivals of what is not certain, tried in its place once all others are there
_ANEW = 2


def by_what_comes_next(
    trial: Trial, base: Model, vocabulary: tuple[type[AbstractEffect], ...] | None
) -> tuple[Model, Judged] | None:
    """The model with what the next sample asks for, and what is to be said, if free runs through the held-out runs bear
    it out.
    """
    ahead = Ahead(trial)
    start = best = ahead.begin(base)
    named: list[Named] = []
    judged, fallen, refusals = NOTHING, set[str](), 0
    while len(best.added) < _MANY and refusals <= _REFUSALS:
        selector = listed(best.view, vocabulary)
        selector.lose_free_run()
        selector.usable[[effect.label in fallen for effect in selector.candidates]] = False
        found = weighed(best.view, selector, trial.progress)
        said = judge(found.naming, found.pattern, found.memory)
        chosen = worth_trying(found, said)
        if not chosen:
            break
        grown = _grown(ahead, start, Tries(ahead.with_effects, best, found, False), chosen, named)
        if grown is None:
            fallen.add(selector.candidates[chosen[0]].label)
            refusals += 1
            continue
        judged = both(judged, dataclasses.replace(said, named=[], notes=[]))
        best, named, refused = grown
        fallen |= refused
    best, named = _asked_again(ahead, start, best, named)
    best, named, gains = asked_for(ahead, start, best, named)
    whole = proved(trial, base, best) if named else None
    if whole is None:
        return None
    judged = settled(judged, named)
    for one in named:
        judged = helped(judged, one.effect, gains[one.effect.label])
    return whole, by_all(judged, whole.shown.pieces)


def _grown(
    ahead: Ahead, start: Model, tries: Tries, chosen: Sequence[int], named: Sequence[Named]
) -> tuple[Model, list[Named], set[str]] | None:
    """The model with those of `chosen` and of what was `named` before that the held-out runs ask for beside each other,
    if they gain, and what they refuse; or with the first of them alone where the others lead astray.

    One that they refuse takes none of the others along. What is chosen first does most, and of what is so large a
    linear picture sees other things in its place.
    """
    before = tries.model([])
    for some in [chosen, chosen[:1]][: len(chosen)]:
        kept = borne_out(tries, some)
        more = [*named, *refitted_all(tries, kept, ())]
        model, stand, _ = asked_for(ahead, start, tries.model([*kept]), more)
        if luck(before.shown, model.shown, model.stands, freely=False).helps:
            return model, stand, {one.effect.label for one in more} - {one.effect.label for one in stand}
    return None


def _asked_again(ahead: Ahead, start: Model, best: Model, named: Sequence[Named]) -> tuple[Model, list[Named]]:
    """The model with a rival in the place of what is not certain, where that is more probable beside all others."""
    said = []
    for one in named:
        models = [(one.effect, best)]
        there = {effect.label for effect in best.added}
        rivals = [rival for rival, _ in one.rivals[:_ANEW] if rival.label not in there]
        if one.probability < CERTAIN:
            models += [(rival, ahead.instead(start, best, one.effect.label, rival)) for rival in rivals]
        models = [(effect, model) for effect, model in models if model.stands] or models[:1]
        values = [(effect, -float(model.fit.cost)) for effect, model in models]
        place = int(np.argmax([value for _, value in values]))
        best = models[place][1]
        said.append(refitted(dataclasses.replace(one, effect=models[place][0]), values))
    return best, said


def asked_for(
    ahead: Ahead, start: Model, best: Model, named: Sequence[Named]
) -> tuple[Model, list[Named], dict[str, Luck]]:
    """The model with those of `named` that the held-out runs ask for beside the others, and what they gain by each."""
    while named and best.view.finite:
        gains = {one.effect.label: ahead.without(best, one.effect) for one in named}
        luck_of = {one.effect.label: p_value(best.view, one.effect) for one in named}
        # first of all what is not told, then what the held-out runs do not ask for, the least first
        asked = lambda label, gains=gains, luck_of=luck_of: (
            -max(luck_of[label], SIGNIFICANCE),
            gains[label].helps,
            np.nan_to_num(gains[label].likelihood),
        )
        worst = min(gains, key=asked)
        if gains[worst].helps and luck_of[worst] < SIGNIFICANCE:
            return best, [*named], gains
        named = [one for one in named if one.effect.label != worst]
        best = ahead.instead(start, best, worst)
    return start, [], {}
