"""What has no name, described: effects that stand in for it in free runs, and a smooth force beside them.

A name claims a cause, and needs evidence that it is this one and no other. A model is to be used all the same. So what
makes its simulation better, in cross-validation, may stand in it and claims nothing: some effects of the
vocabulary, and a smooth force of one variable. What was named is fitted again beside it, unless the two are so much
alike, such as friction and any force of the rate, that the recordings would not tell its numbers any more: then it
keeps them.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ..effects import AbstractEffect, AbstractInstrument, parameter_table
from ..likelihood import Disturbance
from .acceptance import Examination, Model, ModelFitter
from .cross_validation import compare
from .examine import listed, weighed
from .model import is_admissible, with_coloured_errors
from .progress import OutOfTime
from .selector import Selector
from .settings import (
    FORCE_SPREADS,
    MOST_EFFECTS,
    PLACE_SHARE,
    SURROGATE_FITS,
    SURROGATE_GAIN,
    SURROGATE_INFLATION,
    SURROGATE_ROUNDS,
)
from .verdict import Judged, helped, incomplete, standing_in


def described(
    fitter: ModelFitter,
    named: Model,
    found: Examination,
    judged: Judged,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, Judged]:
    """A `named` model with what describes what has no name in the last look at it, and what is to be said.

    Where the time is spent before, it is the `named` model.
    """
    try:
        return _described(fitter, named, found, judged, vocabulary)
    except OutOfTime:
        return named, incomplete(judged)


def _described(
    fitter: ModelFitter,
    named: Model,
    found: Examination,
    judged: Judged,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, Judged]:
    model, selector = named, found.selector
    for _ in range(SURROGATE_ROUNDS if found.unexplained else 0):
        more = _with_more(fitter, named, model, selector)
        if more is None:
            break
        model, selector = more, listed(more.view, vocabulary)
    standing = model.added[len(named.added) :]
    if standing:
        judged = standing_in(judged, standing)
        found = weighed(model.view, selector, fitter.progress)
    return _with_force(fitter, named, model, found, judged)


def _with_more(fitter: ModelFitter, named: Model, model: Model, selector: Selector) -> Model | None:
    """The model with what free runs ask for most, if it is accepted.

    What comes out of a fit with numbers that physics does not admit is asked for no more, and others instead; of what
    does not help only the first half is tried again.
    """
    asked = freest(selector)
    for _ in range(SURROGATE_FITS):
        if not asked:
            return None
        more = _fitted(fitter, named, model, asked, selector.evidence.best([])[1].disturbance)
        wrong = {effect.label for effect in asked if not is_admissible(more.fit, [effect])}
        if wrong:
            selector.usable[[effect.label in wrong for effect in selector.candidates]] = False
            asked = freest(selector)
        elif _worth(model, more):
            return more
        else:
            asked = asked[: len(asked) // 2]
    return None


def _worth(model: Model, more: Model) -> bool:
    """Whether what stands in is accepted and removes some of the simulation error.

    What hardly changes anything may do so significantly, and would then ask for a round of fits more.
    """
    gain = compare(model.predicted, more.predicted)
    better = gain.ratio < 1.0 - SURROGATE_GAIN and float(more.fit.cost) < float(model.fit.cost)
    return more.view.finite and gain.accepted and better


def _fitted(
    fitter: ModelFitter, named: Model, model: Model, effects: Sequence[AbstractEffect], disturbance: Disturbance
) -> Model:
    """The model with some effects, in which what was named is known about as well as it was, or keeps its numbers."""
    more = fitter.with_effects(model, effects, disturbance)
    own = [row.name for effect in named.added for row in parameter_table(effect).values()]
    free = [name for name in own if name in more.fit.names]
    if not free or not is_admissible(more.fit, effects) or not float(more.fit.cost) < float(model.fit.cost):
        return more
    before, after = (with_coloured_errors(one.view, one.fit).standard_errors for one in (named, more))
    if all(after[name] < SURROGATE_INFLATION * before[name] for name in free):
        return more
    return fitter.with_effects(_holding(model, named, own), effects, disturbance)


def _holding(model: Model, named: Model, names: Sequence[str]) -> Model:
    """The model with some numbers held at what they are where they were named."""
    values = named.fit.vehicle.values()
    held = lambda vehicle: vehicle.with_values({name: values[name] for name in names}).holding(names)
    fit = dataclasses.replace(model.fit, vehicle=held(model.fit.vehicle))
    return model._replace(fit=fit, view=dataclasses.replace(model.view, vehicle=held(model.view.vehicle)))


def freest(selector: Selector) -> list[AbstractEffect]:
    """What explains most of a free run's errors, one on top of the other, with the numbers that a free run predicts.

    Of what moves the vehicle: a sensor that is wrong is no description of it.
    """
    chosen: list[int] = []
    while len(chosen) < MOST_EFFECTS:
        share = selector.of_free_run(chosen)
        taken = {selector.candidates[i].label for i in chosen}
        may = [int(i) for i in np.argsort(-share) if selector.usable[i] and selector.candidates[i].label not in taken]
        moves = (i for i in may if not isinstance(selector.candidates[i], AbstractInstrument))
        best = next((i for i in moves if selector.freely_predicted(chosen, i)[1]), None)
        if best is None or share[best] < PLACE_SHARE:
            break
        chosen.append(best)
    beside = [selector.freely_predicted([j for j in chosen if j != i], i) for i in chosen]
    return [effect for effect, admitted in beside if admitted]


def _with_force(
    fitter: ModelFitter, named: Model, base: Model, found: Examination, judged: Judged
) -> tuple[Model, Judged]:
    """The model with the force without a name, if it is accepted.

    How far from zero it is was asked of its shape in detail, and its few knots may overdo it: so half of that is tried,
    and less where free runs err less with it.
    """
    if found.pattern is None or not found.pattern.joins:
        return base, judged
    force, disturbance = found.pattern.force, found.naming.products.disturbance
    last = np.inf
    for share in FORCE_SPREADS:
        less = dataclasses.replace(force, spread=share * force.spread)
        more = _fitted(fitter, named, base, [less], disturbance)
        gain = compare(base.predicted, more.predicted, more.admissible)
        if gain.accepted and more.view.finite:
            return more, helped(judged, less.label, gain)
        if gain.ratio > last:
            break
        last = gain.ratio
    return base, helped(judged, force.label, gain)
