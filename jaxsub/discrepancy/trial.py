"""Effects put into the model, fitted, and compared with the model without them."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..effects import AbstractEffect
from ..estimate import Ended, Fit
from ..likelihood import Disturbance
from ..vehicle import AbstractVehicle
from .cross_validation import Comparison, Predicted, compare, one_step_ahead, simulated
from .evidence import evidence_of
from .generic import Pattern, most_explained
from .model import freed, join, p_value, sound, told
from .name import Named, Naming, named_on, refitted, standing
from .programs import make_room
from .progress import Progress
from .rivals import told_apart
from .selector import Selector
from .settings import DOMINANT_SHARE, FORCE_RATIO, SIGNIFICANCE
from .stiffness import substeps_for, substeps_unseen
from .verdict import Judged, helped, settled
from .view import View, look
from .whiteness import Memory

# candidates by number with the log evidence of a fit
Fits = list[tuple[int, float]]


@dataclasses.dataclass(frozen=True)
class Found:
    """What the vocabulary says about the recordings from one view of them, and a force without a name, if asked.

    `memory` says whether what the named leave is random.
    """

    view: View
    selector: Selector
    naming: Naming
    pattern: Pattern | None
    memory: Memory

    @property
    def remains(self) -> bool:
        """Whether there is something beside what was named."""
        return self.memory.correlated or self.nameless is not None

    @property
    def nameless(self) -> str | None:
        """The equation of the force without a name, if it is there."""
        return self.pattern.force.equation if self.pattern is not None and self.pattern.significant else None


class Model(NamedTuple):
    """Where a search ended, its view, how it predicts blocks of the training runs, the effects added to the baseline.

    Its simulations are begun anew in each of `pieces` of a run.
    """

    fit: Ended
    view: View
    predicted: Predicted
    added: tuple[AbstractEffect, ...]
    pieces: int = 1

    @property
    def admitted(self) -> bool:
        """Whether all came out of the fit as physics admits."""
        return sound(self.fit, self.added)

    @property
    def stands(self) -> bool:
        """Whether moreover the recordings tell each beside the others."""
        return self.admitted and told(self.view, self.added)


@dataclasses.dataclass(frozen=True)
class Trial:
    """How models with more effects are made: `file` is the vehicle as its user describes it, `progress` is told."""

    progress: Progress
    file: AbstractVehicle

    def with_effects(
        self,
        model: Model,
        effects: Sequence[AbstractEffect],
        disturbance: Disturbance,
        near: Sequence[AbstractVehicle] = (),
    ) -> Model:
        """A model with `effects` more, fitted again; the `disturbance` is where one may look for its own.

        The fit begins at vehicles with these effects that are `near` too.
        """
        make_room()
        self.progress(f"fitting with {', '.join(effect.label for effect in effects)}")
        joined = join(model.view, model.fit, effects, self.file, near)
        substeps = substeps_for(joined.vehicle, joined.runs, model.view.path.start)
        if substeps > joined.runs.substeps:
            finer = dataclasses.replace(model.fit, runs=dataclasses.replace(model.fit.runs, substeps=substeps))
            joined = join(model.view, finer, effects, self.file, near)
        substeps = substeps_unseen(joined.vehicle, joined.runs, joined.start, joined.sigma)
        if substeps > joined.runs.substeps:
            runs = dataclasses.replace(joined.runs, substeps=substeps)
            joined = freed(dataclasses.replace(joined, runs=runs), joined.vehicle)
        view = look(joined, disturbance)
        return fitted_model(joined, view, (*model.added, *effects))


def fitted_model(fit: Fit, view: View, added: tuple[AbstractEffect, ...]) -> Model:
    """The model of a fit and of the view of it."""
    return Model(fit, view, Predicted(one_step_ahead(view), simulated(fit)), added)


class Tries:
    """Models with some of the candidates of one look at the recordings, by number, each fitted once.

    `make` puts effects into a model as `Trial.with_effects` does.
    """

    def __init__(self, make: Callable[..., Model], base: Model, found: Found):
        self.make, self.found = make, found
        self.models: dict[tuple[int, ...], Model] = {(): base}
        self.values: dict[tuple[int, ...], float] = {}
        self.said: dict[int, Comparison] = {}

    def effects(self, numbers: Sequence[int]) -> list[AbstractEffect]:
        """With the numbers that are predicted for each beside the others."""
        beside = lambda i: self.found.selector.scan([j for j in numbers if j != i])
        return [beside(i).effects[i] for i in numbers]

    def model(self, numbers: Sequence[int]) -> Model:
        """The base with these."""
        key, disturbance = tuple(sorted(numbers)), self.found.naming.products.disturbance
        if key not in self.models:
            near = self._near(key)
            self.models[key] = self.make(self.models[()], self.effects(key), disturbance, near)
        return self.models[key]

    def _near(self, key: tuple[int, ...]) -> list[AbstractVehicle]:
        """The best vehicle with these and others, without the others: what is left out did little where it was fitted.

        From the numbers of a model without them all, a fit of few may end far from where that of more did.
        """
        more = [other for other in self.models if set(other) > set(key) and key]
        if not more:
            return []
        best = min(more, key=lambda other: float(self.models[other].fit.cost))
        vehicle = self.models[best].fit.vehicle
        for index in set(best) - set(key):
            vehicle = vehicle.without_effect(self.found.selector.candidates[index].label)
        return [vehicle]

    def sound(self, numbers: Sequence[int]) -> bool:
        """Whether their model stands."""
        return self.model(numbers).stands

    def unsound(self, numbers: Sequence[int]) -> list[int]:
        """Those of a set that did not come out of its fit so, the worst first."""
        model, key = self.model(numbers), sorted(numbers)
        own = dict(zip(key, model.added[len(model.added) - len(key) :], strict=True))
        luck = {i: p_value(model.view, effect) if sound(model.fit, [effect]) else 1.0 for i, effect in own.items()}
        return [i for i in sorted(luck, key=lambda i: -luck[i]) if not luck[i] < SIGNIFICANCE]

    def helps(self, fewer: Sequence[int], more: int) -> bool:
        """Whether one more on top of `fewer` is accepted; what was found is kept in `said`."""
        self.said[more] = self.compared(fewer, [*fewer, more])
        return self.said[more].accepted

    def compared(self, fewer: Sequence[int], more: Sequence[int]) -> Comparison:
        """What is gained from the one set to the other."""
        return compare(self.model(fewer).predicted, self.model(more).predicted, self.sound(more))

    def value(self, numbers: Sequence[int]) -> float:
        """Log evidence of the fit with these; minus infinity where physics does not admit its numbers."""
        key = tuple(sorted(numbers))
        if key not in self.values:
            model = self.model(key)
            self.values[key] = evidence_of(model.view) if model.admitted else -np.inf
        return self.values[key]

    def closest(self, others: Sequence[int], index: int) -> Fits:
        """A candidate and its twins, the `others` beside them, with the log evidence of their fits; the best first.

        Those whose fits do not stand come last: what the recordings do not tell from nothing beside a coefficient that
        does the same may be as probable as what they do, and is its rival.
        """
        twins = [number for number in named_on(self.found.selector, others, index).twins if number not in others]
        numbers = [index, *twins]
        predicted = [self.model([*others, i]).predicted for i in numbers]
        values = told_apart([self.value([*others, i]) for i in numbers], predicted)
        fits = zip(numbers, values, strict=True)
        return sorted(fits, key=lambda fit: (not self.sound([*others, fit[0]]), -fit[1]))


def together(tries: Tries, chosen: Sequence[int]) -> dict[int, Fits]:
    """As many of `chosen` as stand together, each as the best of its twins; nothing if none do.

    What is not accepted beside the others is left out: what is left out wrongly is found again from a model with them.
    """
    while chosen:
        kept = borne_out(tries, chosen)
        if not kept or not tries.compared([], [*kept]).accepted:
            return {}
        idle = next((i for i in reversed([*kept]) if not tries.helps([j for j in kept if j != i], i)), None)
        if idle is None:
            return kept
        chosen = [i for i in kept if i != idle]
    return {}


def borne_out(tries: Tries, chosen: Sequence[int]) -> dict[int, Fits]:
    """As many of `chosen` as their fit together bears out, each as the best of its twins.

    With one of two alone the coefficients take up the other, so all are fitted first.
    """
    chosen = upright(tries, chosen)
    kept: dict[int, Fits] = {}
    for place, index in enumerate(chosen):
        fits = tries.closest([*kept, *chosen[place + 1 :]], index)
        kept[fits[0][0]] = fits
    return kept


def upright(tries: Tries, chosen: Sequence[int]) -> Sequence[int]:
    """As many of `chosen` as come out of their fit together as physics admits, each told beside the others."""
    while unsound := tries.unsound(chosen) if chosen else []:
        # of two that trade with each other neither is told, and one may be there
        chosen = [i for i in chosen if i not in unsound] or [i for i in chosen if i != unsound[0]]
    return chosen


def alone(tries: Tries, chosen: Sequence[int]) -> dict[int, Fits]:
    """The first that stands by itself of `chosen` and their twins, the most probable fit first; with its rivals.

    A twin that is more probable and not accepted is none of its rivals.
    """
    for fits in sorted((tries.closest([], index) for index in chosen), key=lambda fits: -fits[0][1]):
        for place, (index, _) in enumerate(fits):
            if tries.sound([index]) and tries.helps([], index):
                return {index: fits[place:]}
    return {}


def leading(selector: Selector, chosen: Sequence[int]) -> list[int]:
    """That one of `chosen`, if any, which alone gains nearly all that they gain together.

    A linear picture is off by some of what the largest effect does, and that is what small ones beside it may be: they
    are asked again from the model with the large one, which takes a fit and not one for every set of them.
    """
    before = selector.value([])
    gains = {index: selector.value([index]) - before for index in chosen}
    best = max(gains, key=lambda index: gains[index])
    return [best] if gains[best] > DOMINANT_SHARE * (selector.value(chosen) - before) else []


def tried(trial: Trial, base: Model, found: Found, chosen: Sequence[int], judged: Judged) -> tuple[Model, Judged]:
    """The model with those of `chosen` that are accepted, and what is then to be said.

    The one that leads, or all together, or else the best that stands alone: where the model errs much, a linear
    picture adds effects that only make up for each other, and one of them put into the model shows what is left.
    Where none does, those that were fitted are no candidates of `found` any more.
    """
    freely = not found.selector.freely.isdisjoint(chosen)
    tries, effects = Tries(trial.with_effects, base, found), found.selector.candidates
    kept = alone(tries, leading(found.selector, chosen))
    if not kept and len(chosen) > 1:
        kept = together(tries, chosen) or alone(tries, chosen)
    refused = [index for index, gain in tries.said.items() if index not in kept and not gain.accepted]
    for index in [*refused, *kept]:
        judged = helped(judged, effects[index].label, tries.said[index])
    # how probable each is was said before twins were fitted, and with what was refused in the model
    if not kept:
        # a fit has found the best shape of its effect: other shapes of it would end there too
        fallen = {effects[key[0]].label for key in tries.models if len(key) == 1}
        found.selector.usable[[effect.label in fallen for effect in effects]] = False
    # a twin stands where a free run asked for the other, and so beside the same rivals
    found.selector.freely.update(kept if freely else ())
    return tries.model([*kept]), settled(judged, refitted_all(tries, kept, refused))


def refitted_all(tries: Tries, kept: dict[int, Fits], refused: Sequence[int]) -> list[Named]:
    """What was kept with the probabilities of it and its twins by the log evidence of fits, what was refused apart."""
    selector = tries.found.selector
    named = standing(selector, [*kept], refused)
    return [refitted(one, [(selector.candidates[i], value) for i, value in kept[one.number]]) for one in named]


def worth_trying(found: Found, judged: Judged) -> list[int]:
    """By number what was named, or, where nothing was, what rules a free run unless it is something without a name.

    Of those chosen, or else of all that the recordings ask for. A force that leaves so much less of a free run's errors
    shows that the ruling effect is not their cause, and where it was not chosen one that leaves any less.
    """
    numbers = [one.number for one in found.naming.named]
    if judged.named:
        return numbers
    selector = found.selector
    share = selector.ruling()
    if not np.any(share):
        return []
    nameless = 1.0 - most_explained(found.view, selector.free.disturbance)
    for among, less in ((numbers, FORCE_RATIO), (range(len(share)), 1.0)):
        best = max(among, key=lambda i: share[i], default=None)
        if best is not None and share[best] > 0.0 and 1.0 - share[best] <= less * nameless:
            selector.freely.add(best)
            return [best]
    return []
