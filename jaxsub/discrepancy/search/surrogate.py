"""Surrogate terms: effects and a nonparametric force that improve the simulation of an unexplained mismatch.

A named effect claims a cause, and needs evidence against all others. A model is to be used all the same. So terms that
improve simulation in cross-validation may be added without any claim: effects of the vocabulary, and a smooth force of
one variable. Named effects are estimated again beside them, unless the two are nearly collinear, such as friction and a
force of the rate: then they keep their parameters.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...effects import AbstractEffect, AbstractInstrument, RunVariation, parameter_table
from ...likelihood import Disturbance
from .. import settings
from ..accept.acceptance import Examination, Model, ModelFitter
from ..accept.cross_validation import compare
from ..accept.model import is_admissible, with_coloured_errors
from ..accept.verdict import Judged, incomplete, with_gain, with_surrogate_note
from ..linearise.products import Products
from ..propose.selector import Selector
from ..records.progress import OutOfTime
from .examine import listed, weighed


def with_surrogate(
    fitter: ModelFitter,
    named: Model,
    found: Examination,
    judged: Judged,
    vocabulary: tuple[type[AbstractEffect], ...] | None,
) -> tuple[Model, Judged]:
    """A `named` model with surrogate terms for what its last examination leaves unexplained, and the judgement.

    Where time runs out before, it is the `named` model.
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
    model, selector, fallen = named, found.selector, set[str]()
    for _ in range(1 + settings.ALTERNATIVES if found.unexplained else 0):
        more = _with_more(fitter, named, model, selector, fallen)
        if more is None:
            break
        model, selector = more, listed(more.view, vocabulary)
    added = model.added[len(named.added) :]
    if added:
        judged = with_surrogate_note(judged, added)
        found = weighed(model.view, selector, fitter.progress)
    return _with_force(fitter, named, model, found, judged)


def _with_more(fitter: ModelFitter, named: Model, model: Model, selector: Selector, fallen: set[str]) -> Model | None:
    """The model with terms that explain most of its error, if they are accepted: in simulation first, then one step on.

    A simulation that other causes have led far off proposes what imitates them, and under a larger disturbance an error
    differs from them. Terms with inadmissible fitted parameters are left out for good, with their labels in
    `fallen`, and where none of them is admissible others are tried. Of terms that are rejected only the first half is
    tried again.
    """
    left_out = lambda: [effect.label in fallen for effect in selector.candidates]
    selector.usable[left_out()] = False
    fits, disturbance = 0, selector.evidence.best([])[1].disturbance
    for products in (selector.simulation, *reversed(selector.evidence.given)):
        proposed = most_explaining(selector, products)
        while proposed and fits < settings.MOST_EFFECTS:
            more, fits = _fitted(fitter, named, model, proposed, disturbance), fits + 1
            wrong = {effect.label for effect in proposed if not is_admissible(more.fit, [effect])}
            if wrong:
                fallen |= wrong
                selector.usable[left_out()] = False
                proposed = [effect for effect in proposed if effect.label not in wrong]
                proposed = proposed or most_explaining(selector, products)
            elif _worth(model, more):
                return more
            else:
                proposed = proposed[: len(proposed) // 2]
    return None


def _worth(model: Model, more: Model) -> bool:
    """Whether the surrogate terms are accepted and remove enough of the simulation error.

    A significant but negligible change would cost another round of fits.
    """
    gain = compare(model.predicted, more.predicted)
    better = gain.ratio < 1.0 - settings.MINOR_SHARE and float(more.fit.cost) < float(model.fit.cost)
    return more.view.finite and gain.accepted and better


def _fitted(
    fitter: ModelFitter, named: Model, model: Model, effects: Sequence[AbstractEffect], disturbance: Disturbance
) -> Model:
    """The model with surrogate terms; named effects that would lose most of their precision keep their values."""
    more = fitter.with_effects(model, effects, disturbance)
    own = [row.name for effect in named.added for row in parameter_table(effect).values()]
    free = [name for name in own if name in more.fit.names]
    if not free or not is_admissible(more.fit, effects) or not float(more.fit.cost) < float(model.fit.cost):
        return more
    before, after = (with_coloured_errors(one.view, one.fit).standard_errors for one in (named, more))
    if all(settings.MAJORITY * after[name] < before[name] for name in free):
        return more
    return fitter.with_effects(_holding(model, named, own), effects, disturbance)


def _holding(model: Model, named: Model, names: Sequence[str]) -> Model:
    """The model with some parameters held at their values in the `named` model."""
    values = named.fit.vehicle.values()
    held = lambda vehicle: vehicle.with_values({name: values[name] for name in names}).holding(names)
    fit = dataclasses.replace(model.fit, vehicle=held(model.fit.vehicle))
    return model._replace(fit=fit, view=dataclasses.replace(model.view, vehicle=held(model.view.vehicle)))


def most_explaining(selector: Selector, products: Products) -> list[AbstractEffect]:
    """The candidates that explain most under a disturbance, by forward selection, with predicted parameters.

    Sensor effects are left out: they do not describe the vehicle. So is what differs by run, which predicts no other.
    """
    chosen: list[int] = []
    while len(chosen) < settings.MOST_EFFECTS:
        share = products.explained(selector.columns(chosen), selector.owners)
        taken = {selector.candidates[i].label for i in chosen}
        may = [int(i) for i in np.argsort(-share) if selector.usable[i] and selector.candidates[i].label not in taken]
        moves = (i for i in may if not isinstance(selector.candidates[i], AbstractInstrument | RunVariation))
        best = next((i for i in moves if selector.predicted(chosen, i, products)[1]), None)
        if best is None or share[best] < settings.PLACE_SHARE:
            break
        chosen.append(best)
    beside = [selector.predicted([j for j in chosen if j != i], i, products) for i in chosen]
    return [effect for effect, admitted in beside if admitted]


def _with_force(
    fitter: ModelFitter, named: Model, base: Model, found: Examination, judged: Judged
) -> tuple[Model, Judged]:
    """The model with the nonparametric force, if it is accepted.

    Its prior standard deviation was estimated with many knots and may be too wide for its few: so it is halved as long
    as the simulation error falls.
    """
    if found.pattern is None or not found.pattern.joins:
        return base, judged
    force, disturbance = found.pattern.force, found.naming.products.disturbance
    last = np.inf
    for halvings in range(1 + settings.ALTERNATIVES):
        less = dataclasses.replace(force, spread=0.5**halvings * force.spread)
        more = _fitted(fitter, named, base, [less], disturbance)
        gain = compare(base.predicted, more.predicted, more.admissible)
        if gain.accepted and more.view.finite:
            return more, with_gain(judged, less.label, gain)
        if gain.ratio > last:
            break
        last = gain.ratio
    return base, with_gain(judged, force.label, gain)
