"""Proposed effects added to the model, fitted, and accepted or rejected against the model without them."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...effects import AbstractEffect, AbstractMemory
from ...estimate import AbstractSearchEnd, Solution, substeps_for, substeps_unseen
from ...likelihood import Disturbance
from ...vehicle import AbstractVehicle
from .. import settings
from ..linearise.evidence import evidence_of
from ..linearise.view import View, look
from ..linearise.whiteness import Memory
from ..programs import make_room
from ..propose.name import Named, Naming, named_on, refitted, with_probabilities
from ..propose.nonparametric import Pattern, most_explained
from ..propose.selector import Selector
from ..records.progress import Progress
from .cross_validation import Comparison, Predicted, compare, one_step_ahead, simulated
from .model import are_significant, fit_with, is_admissible, p_value, refit, with_scaled_effects
from .rivals import robust_log_evidence
from .verdict import Judged, concluded, with_gain

# candidates by number with the log evidence of a fit
Fits = list[tuple[int, float]]


@dataclasses.dataclass(frozen=True)
class Examination:
    """What the candidates, and a nonparametric force, explain of the innovations of one model.

    **Fields**

    - `view`: the model and its filtered trajectory. `selector`: the evidence of every candidate there.
    - `naming`: the effects selected. `pattern`: the best nonparametric force, None where none was sought.
    - `memory`: the test of whether the innovations that the selected effects leave are white.
    """

    view: View
    selector: Selector
    naming: Naming
    pattern: Pattern | None
    memory: Memory

    @property
    def numbers(self) -> list[int]:
        """Of the selected effects."""
        return [one.number for one in self.naming.named]

    @property
    def unexplained(self) -> bool:
        """Whether the selected effects leave correlated innovations or a significant nonparametric force."""
        return self.memory.correlated or self.nonparametric is not None

    @property
    def nonparametric(self) -> str | None:
        """The equation of the nonparametric force, if it is significant."""
        return self.pattern.force.equation if self.pattern is not None and self.pattern.significant else None


class Model(NamedTuple):
    """A fitted model and what its acceptance depends on.

    **Fields**

    - `fit`: maximum likelihood in simulation. `view`: the same model along its filtered trajectory.
    - `predicted`: log predictive density of each block of the training runs. `added`: effects beside the baseline's.
    - `pieces`: of a run, in each of which its simulation is re-initialised.
    """

    fit: AbstractSearchEnd
    view: View
    predicted: Predicted
    added: tuple[AbstractEffect, ...]
    pieces: int = 1

    @property
    def admissible(self) -> bool:
        """Whether physics admits all fitted parameters of the added effects."""
        return is_admissible(self.fit, self.added)

    @property
    def significant(self) -> bool:
        """Whether moreover each added effect is significant beside the others (Wald test)."""
        return self.admissible and are_significant(self.view, self.added)

    def p_value_of(self, effect: AbstractEffect) -> float:
        """The p-value of one of its effects beside the others (Wald test), 1 where inadmissible."""
        return p_value(self.view, effect) if is_admissible(self.fit, [effect]) else 1.0


@dataclasses.dataclass(frozen=True)
class ModelFitter:
    """Fits models with more effects: `file` is the vehicle as its user describes it, `progress` is informed."""

    progress: Progress
    file: AbstractVehicle

    def with_effects(
        self,
        model: Model,
        effects: Sequence[AbstractEffect],
        disturbance: Disturbance,
        near: Sequence[AbstractVehicle] = (),
    ) -> Model:
        """A model with `effects` added, fitted again.

        The search for its disturbance may start at `disturbance`, that for its parameters also at the vehicles `near`.
        """
        make_room()
        self.progress(f"fitting with {', '.join(effect.label for effect in effects)}")
        joined = fit_with(model.view, model.fit, effects, self.file, near)
        substeps = substeps_for(joined.vehicle, joined.runs, model.view.path.start)
        if substeps > joined.runs.substeps:
            finer = dataclasses.replace(model.fit, runs=dataclasses.replace(model.fit.runs, substeps=substeps))
            joined = fit_with(model.view, finer, effects, self.file, near)
        if any(isinstance(effect, AbstractMemory) for effect in effects):
            # states of their own may turn far within a step that all else is followed by
            substeps = substeps_unseen(joined.vehicle, joined.runs, joined.start, joined.sigma)
            if substeps > joined.runs.substeps:
                runs = dataclasses.replace(joined.runs, substeps=substeps)
                joined = refit(dataclasses.replace(joined, runs=runs), joined.vehicle)
        view = look(joined, disturbance, with_scaled_effects(model.view.vehicle, effects, 1.0))
        return fitted_model(joined, view, (*model.added, *effects))


def fitted_model(fit: Solution, view: View, added: tuple[AbstractEffect, ...]) -> Model:
    """The model of a fit and of the view of it."""
    return Model(fit, view, Predicted(one_step_ahead(view), simulated(fit)), added)


class CandidateModels:
    """Models with some of the candidates of one examination, by their numbers, each fitted once.

    `make` adds effects to a model as `ModelFitter.with_effects` does.
    """

    def __init__(self, make: Callable[..., Model], base: Model, found: Examination):
        self.make, self.found = make, found
        self.by_numbers: dict[tuple[int, ...], Model] = {(): base}
        self.values: dict[tuple[int, ...], float] = {}
        self.comparisons: dict[int, Comparison] = {}

    def effects(self, numbers: Sequence[int]) -> list[AbstractEffect]:
        """The candidates, each with the parameters that the linearised model predicts beside the others."""
        beside = lambda i: self.found.selector.scan([j for j in numbers if j != i])
        return [beside(i).effects[i] for i in numbers]

    def model(self, numbers: Sequence[int]) -> Model:
        """The base with these candidates, fitted."""
        key, disturbance = tuple(sorted(numbers)), self.found.naming.products.disturbance
        if key not in self.by_numbers:
            near = self._near(key)
            self.by_numbers[key] = self.make(self.by_numbers[()], self.effects(key), disturbance, near)
        return self.by_numbers[key]

    def _near(self, key: tuple[int, ...]) -> list[AbstractVehicle]:
        """The best vehicle fitted with these and other effects, less the others: a warm start.

        From the parameters of a model without them all, a fit with few may end in another optimum than one with more.
        """
        more = [other for other in self.by_numbers if set(other) > set(key) and key]
        if not more:
            return []
        best = min(more, key=lambda other: float(self.by_numbers[other].fit.cost))
        vehicle = self.by_numbers[best].fit.vehicle
        for index in set(best) - set(key):
            vehicle = vehicle.without_effect(self.found.selector.candidates[index].label)
        return [vehicle]

    def is_significant(self, numbers: Sequence[int]) -> bool:
        """Whether each of them is admissible and significant in their model.

        An effect of the base that is neither beside them is no reason against them: it was in their place.
        """
        return not self.insignificant(numbers)

    def insignificant(self, numbers: Sequence[int]) -> list[int]:
        """Those of a set that are inadmissible or insignificant in its fit, the largest p-value first."""
        own = zip(sorted(numbers), self._own(numbers), strict=True)
        p_values = {i: self.model(numbers).p_value_of(effect) for i, effect in own}
        return [i for i in sorted(p_values, key=lambda i: -p_values[i]) if not p_values[i] < settings.SIGNIFICANCE]

    def accepts(self, fewer: Sequence[int], more: int) -> bool:
        """Whether one candidate more on top of `fewer` is accepted; the comparison is kept in `comparisons`."""
        self.comparisons[more] = self.comparison(fewer, [*fewer, more])
        return self.comparisons[more].accepted

    def comparison(self, fewer: Sequence[int], more: Sequence[int]) -> Comparison:
        """The gain in predictive density from the one set to the other."""
        return compare(self.model(fewer).predicted, self.model(more).predicted, self.is_significant(more))

    def log_evidence(self, numbers: Sequence[int]) -> float:
        """Log evidence of the fit with these; minus infinity where physics does not admit its parameters."""
        key = tuple(sorted(numbers))
        if key not in self.values:
            model = self.model(key)
            self.values[key] = evidence_of(model.view) if is_admissible(model.fit, self._own(key)) else -np.inf
        return self.values[key]

    def _own(self, numbers: Sequence[int]) -> tuple[AbstractEffect, ...]:
        """These candidates as effects of their model, in the order of their numbers, without those of the base."""
        added = self.model(numbers).added
        return added[len(added) - len(numbers) :]

    def alternatives(self, others: Sequence[int], index: int) -> Fits:
        """A candidate and those nearly collinear with it, each beside the `others`, by log evidence of their fits.

        The best comes first, insignificant ones come last: beside a coefficient that does the same, an effect may be
        insignificant and as probable as its rival.
        """
        named = named_on(self.found.selector, others, index)
        numbers = [index, *(number for number in named.collinear if number not in others)]
        predicted = [self.model([*others, i]).predicted for i in numbers]
        values = robust_log_evidence([self.log_evidence([*others, i]) for i in numbers], predicted)
        fits = zip(numbers, values, strict=True)
        return sorted(fits, key=lambda fit: (not self.is_significant([*others, fit[0]]), -fit[1]))


def accept_jointly(models: CandidateModels, chosen: Sequence[int]) -> dict[int, Fits]:
    """As many of `chosen` as are accepted together, each as the best of its alternatives; empty if none is.

    All are fitted together first: with one of two alone, the coefficients absorb the other. Alternatives are fitted
    only of a set that is accepted. Each effect is left out that is not accepted beside the others; one that is left out
    wrongly is proposed again from the model with the others.
    """
    accepted = lambda numbers: models.comparison([], numbers).accepted
    while (chosen := without_insignificant(models, chosen)) and accepted(chosen):
        kept = best_alternatives(models, chosen)
        idle = next((i for i in reversed([*kept]) if not models.accepts([j for j in kept if j != i], i)), None)
        if idle is None:
            return kept if accepted([*kept]) else {}
        chosen = [i for i in kept if i != idle]
    return {}


def best_alternatives(models: CandidateModels, chosen: Sequence[int]) -> dict[int, Fits]:
    """Each of `chosen` as the best of its alternatives beside the others."""
    kept: dict[int, Fits] = {}
    for place, index in enumerate(chosen):
        fits = models.alternatives([*kept, *chosen[place + 1 :]], index)
        kept[fits[0][0]] = fits
    return kept


def without_insignificant(models: CandidateModels, chosen: Sequence[int]) -> Sequence[int]:
    """As many of `chosen` as are admissible and significant in their joint fit."""
    while dropped := models.insignificant(chosen) if chosen else []:
        # of two whose estimates are correlated neither is significant, though one may be there
        chosen = [i for i in chosen if i not in dropped] or [i for i in chosen if i != dropped[0]]
    return chosen


def accept_singly(models: CandidateModels, chosen: Sequence[int]) -> dict[int, Fits]:
    """The first of `chosen` and their alternatives that is accepted by itself, the most probable fit first.

    With its rivals: an alternative that is more probable and rejected is none.
    """
    for fits in sorted((models.alternatives([], index) for index in chosen), key=lambda fits: -fits[0][1]):
        for place, (index, _) in enumerate(fits):
            if models.is_significant([index]) and models.accepts([], index):
                return {index: fits[place:]}
    return {}


def dominant(selector: Selector, chosen: Sequence[int]) -> list[int]:
    """That one of `chosen`, if any, whose log evidence alone is nearly that of all together.

    The linearisation error of the largest effect may show as small effects beside it. These are proposed again from the
    model with the large one, at the cost of one fit and not of one for every set of them.
    """
    before = selector.value([])
    gains = {index: selector.value([index]) - before for index in chosen}
    best = max(gains, key=lambda index: gains[index])
    return [best] if gains[best] > settings.NEARLY_ALL * (selector.value(chosen) - before) else []


def accept_proposed(
    fitter: ModelFitter, base: Model, found: Examination, chosen: Sequence[int], judged: Judged
) -> tuple[Model, Judged]:
    """The model with those of `chosen` that are accepted, and the judgement with them.

    The dominant one is tried first, then all together, then each by itself: far from the truth, the linearised model
    selects effects that compensate each other's errors. Where none is accepted, those that were fitted by themselves
    are no candidates of `found` any more.
    """
    models, effects = CandidateModels(fitter.with_effects, base, found), found.selector.candidates
    kept = accept_singly(models, dominant(found.selector, chosen))
    if not kept and len(chosen) > 1:
        kept = accept_jointly(models, chosen) or accept_singly(models, chosen)
    refused = [index for index, gain in models.comparisons.items() if index not in kept and not gain.accepted]
    for index in [*refused, *kept]:
        judged = with_gain(judged, effects[index].label, models.comparisons[index])
    if not kept:
        # a fit has found the best shape of its effect: other shapes of it would end there too
        fallen = {effects[key[0]].label for key in models.by_numbers if len(key) == 1}
        found.selector.usable[[effect.label in fallen for effect in effects]] = False
    # an alternative to what simulation selected has the rivals of that; no other is compared with what was not fitted
    by_simulation = found.selector.by_simulation
    by_simulation.update([i for i, fits in kept.items() if not by_simulation.isdisjoint(number for number, _ in fits)])
    return models.model([*kept]), concluded(judged, with_posteriors(models, kept, refused))


def with_posteriors(models: CandidateModels, kept: dict[int, Fits], refused: Sequence[int]) -> list[Named]:
    """The accepted effects with the posterior probabilities of their alternatives by the log evidence of fits."""
    selector = models.found.selector
    named = with_probabilities(selector, [*kept], refused)
    return [refitted(one, [(selector.candidates[i], value) for i, value in kept[one.number]]) for one in named]


def proposed_effects(found: Examination, judged: Judged) -> list[int]:
    """The numbers of the selected effects, or, where none is, of the one that explains most of the simulation error.

    That one is sought among those chosen, else among all significant candidates. It is not proposed where a
    nonparametric force leaves far less of the simulation error, or any less if it was not chosen.
    """
    if judged.named:
        return found.numbers
    selector = found.selector
    share = selector.majority_shares()
    if not np.any(share):
        return []
    nonparametric = 1.0 - most_explained(found.view, selector.simulation.disturbance)
    for among, less in ((found.numbers, settings.LARGE_ERROR**2), (range(len(share)), 1.0)):
        best = max(among, key=lambda i: share[i], default=None)
        if best is not None and share[best] > 0.0 and 1.0 - share[best] <= less * nonparametric:
            selector.by_simulation.add(best)
            return [best]
    return []
