"""Effects put into the model, fitted, and tried on runs that no fit saw."""

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Array

from ..effects import AbstractEffect
from ..estimate import Fit
from ..likelihood import Disturbance
from ..recording.runs import Runs
from .evidence import evidence_of
from .generic import Pattern
from .model import join, sound
from .name import Naming, named_on, refitted, standing
from .progress import Progress
from .selector import Selector
from .show import HeldOut, hold, luck
from .verdict import Judged, helped, settled
from .view import View, look


@dataclasses.dataclass(frozen=True)
class Found:
    """What the vocabulary says about the recordings from one view of them, and a force without a name, if asked."""

    view: View
    selector: Selector
    naming: Naming
    pattern: Pattern | None


class Model(NamedTuple):
    """A fit, its view, what it shows on the held-out runs, and the effects that were added to the baseline."""

    fit: Fit
    view: View
    shown: HeldOut
    added: tuple[AbstractEffect, ...]


@dataclasses.dataclass(frozen=True)
class Trial:
    """The runs that no fit saw: numbers `chosen` of `runs`, of which the first `size` were fitted."""

    runs: Runs
    chosen: Sequence[int]
    size: int
    sigma: Array
    progress: Progress

    def with_effects(self, model: Model, effects: Sequence[AbstractEffect], disturbance: Disturbance) -> Model:
        """A model with `effects` more, fitted again and tried; a search for its disturbance starts from that given."""
        self.progress(f"fitting with {', '.join(effect.label for effect in effects)}")
        joined = join(model.view, model.fit, effects)
        view = look(joined, disturbance)
        return Model(joined, view, self.held_out(joined, view.disturbance), (*model.added, *effects))

    def held_out(self, fit: Fit, disturbance: Disturbance) -> HeldOut:
        """A fit's vehicle on them."""
        return hold(fit.vehicle, self.runs, self.chosen, self.size, self.sigma, disturbance)


def tried(trial: Trial, base: Model, found: Found, judged: Judged) -> tuple[Model, Judged]:
    """The model with those of the effects `judged` that stand on the held-out runs, and what is then to be said.

    One after the other, since what fails on runs that were not fitted must not take with it what stands; each beside
    its twins, of which the most probable after a fit is taken.
    """
    best, stand, fits = base, [], {}
    disturbance = found.naming.products.disturbance
    for chosen in found.naming.chosen:
        if chosen in stand:
            continue
        taken, named = best.added[len(base.added) :], named_on(found.selector, stand, chosen)
        options = [(chosen, named.effect), *named.twins]
        models = [trial.with_effects(base, [*taken, effect], disturbance) for _, effect in options]
        values = [evidence_of(more.view) if sound(more.fit, more.added) else -np.inf for more in models]
        (number, effect), more = options[int(np.argmax(values))], models[int(np.argmax(values))]
        judged = helped(judged, effect, sound(more.fit, more.added), luck(best.shown, more.shown))
        if effect not in judged.refused:
            best, stand = more, [*stand, number]
            fits[effect.name] = [(option, value) for (_, option), value in zip(options, values, strict=True)]
    # how probable each is was said before twins were fitted, and with what was refused in the model
    return best, settled(judged, [refitted(one, fits[one.effect.name]) for one in standing(found.selector, stand)])


def unnamed(trial: Trial, base: Model, found: Found, judged: Judged) -> tuple[Model, Judged]:
    """The model with the force without a name, if it stands on the held-out runs."""
    if found.pattern is None or not found.pattern.significant:
        return base, judged
    force = found.pattern.force
    more = trial.with_effects(base, [force], found.naming.products.disturbance)
    judged = helped(judged, force, sound(more.fit, more.added), luck(base.shown, more.shown))
    return (base if force in judged.refused else more), judged
