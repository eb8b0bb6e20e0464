"""What has no name, described: effects that stand in for it in free runs, and a smooth force beside them.

A name claims a cause, and needs evidence that it is this one and no other. A model is to be used all the same. So what
makes its free runs err less, on runs that no fit saw too, may stand in it and claims nothing: some effects of the
vocabulary, and a smooth force of one variable. What was named keeps its numbers meanwhile: beside a description that is
much alike, such as friction beside any force of the rate, the recordings would not tell them any more.
"""

import dataclasses

import numpy as np

from ..effects import AbstractEffect, AbstractInstrument, parameter_table
from .explain import listed, weighed
from .model import sound
from .selector import Selector
from .show import luck
from .trial import Found, Model, Trial
from .verdict import Judged, helped, standing_in

# effects that stand in at a time, sets of them that are fitted, and times that more are asked for
_AT_ONCE, _TRIES, _TIMES = 4, 3, 3
# of the squared errors of a free run, the share that each must explain
_ENOUGH = 0.05


def described(
    trial: Trial, named: Model, found: Found, judged: Judged, vocabulary: tuple[type[AbstractEffect], ...] | None
) -> tuple[Model, Judged]:
    """A `named` model with what describes what has no name in the last look at it, and what is to be said."""
    model, selector = _held(named), found.selector
    for _ in range(_TIMES if found.remains else 0):
        more = _with_more(trial, model, selector)
        if more is None:
            break
        model, selector = more, listed(more.view, vocabulary)
    standing = model.added[len(named.added) :]
    if standing:
        judged = standing_in(judged, standing)
        found = weighed(model.view, selector, trial.progress)
    best, judged = _with_force(trial, model, found, judged)
    # with nothing to describe nothing is held
    return (best if len(best.added) > len(named.added) else named), judged


def _held(model: Model) -> Model:
    """The model with the numbers of all that was added to it held at what its fit says."""
    own = [row.name for effect in model.added for row in parameter_table(effect).values()]
    values = model.fit.vehicle.values()
    led = model.view.vehicle.with_values({name: values[name] for name in own})
    fit = dataclasses.replace(model.fit, vehicle=model.fit.vehicle.holding(own))
    return model._replace(fit=fit, view=dataclasses.replace(model.view, vehicle=led.holding(own)))


def _with_more(trial: Trial, model: Model, selector: Selector) -> Model | None:
    """The model with what free runs ask for most, if those through the held-out runs err less with it.

    What comes out of a fit with numbers that physics does not admit is asked for no more, and others instead.
    """
    for _ in range(_TRIES):
        asked = freest(selector)
        if not asked:
            return None
        more = trial.with_effects(model, asked, selector.evidence.best([])[1].disturbance)
        wrong = {effect.label for effect in asked if not sound(more.fit, [effect])}
        if not wrong:
            gain = luck(model.shown, more.shown, True, freely=True)
            return more if gain.helps and np.isfinite(gain.likelihood) else None
        selector.usable[[effect.label in wrong for effect in selector.candidates]] = False
    return None


def freest(selector: Selector) -> list[AbstractEffect]:
    """What explains most of a free run's errors, one on top of the other, with the numbers that a free run predicts.

    Of what moves the vehicle: a sensor that is wrong is no description of it.
    """
    chosen: list[int] = []
    while len(chosen) < _AT_ONCE:
        share = selector.of_free_run(chosen)
        taken = {selector.candidates[i].label for i in chosen}
        may = [i for i in np.argsort(-share) if selector.usable[i] and selector.candidates[i].label not in taken]
        moves = (i for i in may if not isinstance(selector.candidates[i], AbstractInstrument))
        best = next((i for i in moves if selector.freely_predicted(chosen, i)[1]), None)
        if best is None or share[best] < _ENOUGH:
            break
        chosen.append(int(best))
    beside = [selector.freely_predicted([j for j in chosen if j != i], i) for i in chosen]
    return [effect for effect, admitted in beside if admitted]


def _with_force(trial: Trial, base: Model, found: Found, judged: Judged) -> tuple[Model, Judged]:
    """The model with the force without a name, if it stands on the held-out runs."""
    if found.pattern is None or not found.pattern.joins:
        return base, judged
    force = found.pattern.force
    more = trial.with_effects(base, [force], found.naming.products.disturbance)
    gain = luck(base.shown, more.shown, sound(more.fit, more.added), freely=False)
    return (more if gain.helps else base), helped(judged, force, gain)
