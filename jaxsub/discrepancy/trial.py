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
from .programs import make_room
from .progress import Progress
from .selector import Selector
from .show import HeldOut, Luck, hold, luck
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
        make_room()
        self.progress(f"fitting with {', '.join(effect.label for effect in effects)}")
        joined = join(model.view, model.fit, effects)
        view = look(joined, disturbance)
        return Model(joined, view, self.held_out(joined, view.disturbance), (*model.added, *effects))

    def held_out(self, fit: Fit, disturbance: Disturbance) -> HeldOut:
        """A fit's vehicle on them."""
        return hold(fit.vehicle, self.runs, self.chosen, self.size, self.sigma, disturbance)


class Tries:
    """Models with some of the candidates of one look at the recordings, by number, each fitted once."""

    def __init__(self, trial: Trial, base: Model, found: Found):
        self.trial, self.found = trial, found
        self.models: dict[tuple[int, ...], Model] = {(): base}
        self.said: dict[int, tuple[bool, Luck]] = {}

    def effects(self, numbers: Sequence[int]) -> list[AbstractEffect]:
        """With the numbers that are predicted for each beside the others."""
        return [named_on(self.found.selector, [j for j in numbers if j != i], i).effect for i in numbers]

    def model(self, numbers: Sequence[int]) -> Model:
        """The base with these."""
        key, disturbance = tuple(sorted(numbers)), self.found.naming.products.disturbance
        if key not in self.models:
            self.models[key] = self.trial.with_effects(self.models[()], self.effects(key), disturbance)
        return self.models[key]

    def sound(self, numbers: Sequence[int]) -> bool:
        """Whether they came out of the fit as physics admits."""
        return sound(self.model(numbers).fit, self.model(numbers).added)

    def helps(self, fewer: Sequence[int], more: int) -> bool:
        """Whether one more on top of `fewer` stands on the held-out runs; what was found is kept in `said`."""
        whole = [*fewer, more]
        self.said[more] = self.sound(whole), luck(self.model(fewer).shown, self.model(whole).shown)
        return self.said[more][0] and self.said[more][1].helps

    def closest(self, chosen: Sequence[int], index: int) -> list[tuple[int, float]]:
        """A chosen candidate and its twins with the log evidence of their fits, the others chosen beside them."""
        others = [i for i in chosen if i != index]
        twins = [number for number, _ in named_on(self.found.selector, others, index).twins if number not in others]
        value = lambda i: evidence_of(self.model([*others, i]).view) if self.sound([*others, i]) else -np.inf
        return [(i, value(i)) for i in (index, *twins)] if twins else [(index, 0.0)]


def tried(trial: Trial, base: Model, found: Found, judged: Judged) -> tuple[Model, Judged]:
    """The model with those of the effects `judged` that stand on the held-out runs, and what is then to be said.

    First each is told from its twins by their fits. Then all are tried together, and each is left out in turn: with
    one of two alone the coefficients take up the other. Where all together do not stand, one is added after the other.
    """
    tries, chosen, fits = Tries(trial, base, found), list(found.naming.chosen), {}
    for place, index in enumerate(chosen):
        values = tries.closest(chosen, index)
        chosen[place] = max(values, key=lambda pair: pair[1])[0]
        fits[chosen[place]] = [(found.selector.candidates[i], value) for i, value in values]
    kept: list[int] = []
    if len(chosen) > 1 and tries.sound(chosen) and luck(base.shown, tries.model(chosen).shown).helps:
        kept = list(chosen)
        for index in reversed(chosen):
            rest = [i for i in kept if i != index]
            if not tries.helps(rest, index):
                kept = rest
    else:
        for index in chosen:
            kept = [*kept, index] if tries.helps(kept, index) else kept
    for index, effect in zip(chosen, tries.effects(chosen), strict=True):
        judged = helped(judged, effect, *tries.said[index])
    # how probable each is was said before twins were fitted, and with what was refused in the model
    refused = [index for index in chosen if index not in kept]
    stand = [refitted(one, fits[one.number]) for one in standing(found.selector, kept, refused)]
    return tries.model(kept), settled(judged, stand)


def unnamed(trial: Trial, base: Model, found: Found, judged: Judged) -> tuple[Model, Judged]:
    """The model with the force without a name, if it stands on the held-out runs."""
    if found.pattern is None or not found.pattern.significant:
        return base, judged
    force = found.pattern.force
    more = trial.with_effects(base, [force], found.naming.products.disturbance)
    judged = helped(judged, force, sound(more.fit, more.added), luck(base.shown, more.shown))
    return (base if force in judged.refused else more), judged
