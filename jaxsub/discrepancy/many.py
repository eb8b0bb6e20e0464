"""Many effects that are missing at once, one look after the other, by what comes next.

A free run that errs for many causes asks for what does what all of these do. So innovations are asked what is missing
and how large it is, until they ask for nothing more that predicts the held-out runs; and free runs then judge it all.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..effects import AbstractEffect
from .ahead import Ahead, lacking, proved
from .examine import listed, weighed
from .model import p_value
from .name import Named, asked_still, named_on, refitted, standing
from .selector import SIGNIFICANCE, Selector
from .show import Luck, luck
from .trial import Model, Trial, Tries, upright, worth_trying
from .verdict import NOTHING, Judged, both, by_all, helped, judge, settled

# effects beyond which no more are sought, and sets that may be refused
_MANY, _REFUSALS = 16, 2
# of log evidence, what may be less and yet be tried in the place of a name, and how many are
_CLOSE, _ANEW = 3.0, 2
# of what a name explains, the share that a linear picture without it may lose
_LOST = 0.1


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
        best, named = _asked_again(ahead, start, best, named, vocabulary)
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
        kept = upright(tries, some)
        more = [*named, *standing(tries.found.selector, kept)]
        model, stand, _ = asked_for(ahead, start, tries.model(kept), more)
        if luck(before.shown, model.shown, model.stands, freely=False).helps:
            return model, stand, {one.effect.label for one in more} - {one.effect.label for one in stand}
    return None


def _asked_again(
    ahead: Ahead,
    start: Model,
    best: Model,
    named: Sequence[Named],
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, list[Named]]:
    """The model with another in the place of a name, where that is more probable beside all others.

    What was taken first may have stood in for what came after it, and others may do better beside that.
    """
    said, every = [], _all_of(best, vocabulary)
    for one in named:
        one, others = _beside(ahead, start, best, every, one, vocabulary)
        models = [(one.effect, best)]
        models += [(rival, ahead.instead(start, best, one.effect.label, rival)) for rival in others]
        models = [(effect, model) for effect, model in models if model.stands] or models[:1]
        values = [(effect, -float(model.fit.cost)) for effect, model in models]
        effect, model = models[int(np.argmax([value for _, value in values]))]
        if model is best:
            said.append(refitted(one, values))
        else:
            best, every = model, _all_of(model, vocabulary)
            said.append(_beside(ahead, start, best, every, dataclasses.replace(one, effect=effect), vocabulary)[0])
    return best, said


def _all_of(model: Model, vocabulary: tuple[type[AbstractEffect], ...] | None) -> Selector:
    """All that may be asked for, and what the model has."""
    selector = listed(model.view, vocabulary, present=True)
    selector.lose_free_run()
    return selector


def _beside(
    ahead: Ahead,
    start: Model,
    best: Model,
    every: Selector,
    one: Named,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Named, list[AbstractEffect]]:
    """How probable a named effect is beside all others of a model, and what may stand in its place, the best first.

    Asked of a linear picture without it, of which `every` lists all, or, where that does not even give back what was
    taken from it, of a model.
    """
    whole = every.evidence.best([])[0]
    without_it = lambda: _all_of(ahead.instead(start, best, one.effect.label), vocabulary)
    for asked in (lambda: lacking(every, one.effect), without_it):
        selector = asked()
        scan = selector.scan([])
        own = [i for i, effect in enumerate(selector.candidates) if effect.label == one.effect.label]
        number = max(own, key=lambda i, value=scan.value: value[i])
        without, again = (selector.evidence.best(selector.columns(some))[0] for some in ([], [number]))
        if np.isfinite(scan.value[number]) and whole - again < _LOST * (whole - without):
            break
    if not np.isfinite(scan.value[number]):
        return one, []
    close = (scan.value > scan.value[number] - _CLOSE) & ~asked_still(selector, [], number, scan)
    close[own] = False
    others: dict[str, AbstractEffect] = {}
    for i in (i for i in np.argsort(-scan.value) if close[i]):
        others.setdefault(scan.effects[i].label, scan.effects[i])
    return named_on(selector, [], number), [*others.values()][:_ANEW]


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
