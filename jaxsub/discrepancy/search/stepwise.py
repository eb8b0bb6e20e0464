"""Stepwise selection of many missing effects by innovations, with replacement and backward elimination.

The simulation error of a model that lacks many effects favours candidates that imitate them all. So effects are
selected and estimated by one-step-ahead prediction until none more is accepted, and simulation then judges the whole.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...effects import AbstractEffect, RunVariation
from .. import settings
from ..accept.acceptance import CandidateModels, Model, ModelFitter, without_insignificant
from ..accept.cross_validation import Comparison, compare
from ..accept.model import p_value
from ..accept.rivals import robust_log_evidence
from ..accept.verdict import NOTHING, Judged, combined, concluded, found_by_innovations, judge, with_gain
from ..propose.name import Named, named_on, refitted, significant_beside, with_probabilities
from ..propose.selector import Selector
from .examine import listed, weighed
from .innovation_models import InnovationModels, selector_without, validated_in_simulation


def stepwise_by_innovations(
    fitter: ModelFitter, base: Model, vocabulary: tuple[type[AbstractEffect], ...] | None
) -> tuple[Model, Judged] | None:
    """The model that stepwise selection by innovations ends with, and the judgement; None if simulation rejects it."""
    by_innovations = InnovationModels(fitter)
    search = _Search(by_innovations, by_innovations.begin(base), vocabulary)
    best, named = search.start, list[Named]()
    judged, fallen, refusals = NOTHING, set[str](), 0
    while refusals <= settings.ALTERNATIVES:
        selector = search.listed(best)
        selector.usable[[effect.label in fallen for effect in selector.candidates]] = False
        found = weighed(best.view, selector, fitter.progress)
        linearised = judge(found.naming, found.pattern, found.memory)
        chosen = found.numbers if linearised.named else []
        if not chosen:
            break
        grown = search.extended(CandidateModels(by_innovations.with_effects, best, found), chosen, named)
        if grown is None:
            fallen.add(selector.candidates[chosen[0]].label)
            refusals += 1
            continue
        judged = combined(judged, dataclasses.replace(linearised, named=[], notes=[]))
        best, named, refused = grown
        fallen |= refused
        best, named = search.with_alternatives(best, named)
    best, named, gains = backward_eliminated(by_innovations, search.start, best, named)
    whole = validated_in_simulation(fitter, base, best) if named else None
    if whole is None:
        return None
    judged = concluded(judged, named)
    for one in named:
        judged = with_gain(judged, one.effect.label, gains[one.effect.label])
    return whole, found_by_innovations(judged, whole.pieces)


@dataclasses.dataclass(frozen=True)
class _Search:
    """What the steps of one selection share: how models are made, the model it starts from, and the vocabulary."""

    by_innovations: InnovationModels
    start: Model
    vocabulary: tuple[type[AbstractEffect], ...] | None

    def listed(self, model: Model, *, present: bool = False) -> Selector:
        """The candidates on top of a model; with `present` also the effects that it has."""
        return listed(model.view, self.vocabulary, present=present)

    def extended(
        self, models: CandidateModels, chosen: Sequence[int], named: Sequence[Named]
    ) -> tuple[Model, list[Named], set[str]] | None:
        """The model with those of `chosen`, and of the effects `named` before, that are accepted beside each other.

        With the labels of those rejected; None if nothing is gained. Where all of `chosen` together gain nothing, the
        first, which is the largest, is tried alone: its linearisation error may have proposed the others.
        """
        before = models.model([])
        for some in [chosen, chosen[:1]][: len(chosen)]:
            kept = without_insignificant(models, some)
            more = [*named, *with_probabilities(models.found.selector, kept)]
            model, stand, _ = backward_eliminated(self.by_innovations, self.start, models.model(kept), more)
            if compare(before.predicted, model.predicted, model.significant).accepted:
                return model, stand, {one.effect.label for one in more} - {one.effect.label for one in stand}
        return None

    def with_alternatives(self, best: Model, named: Sequence[Named]) -> tuple[Model, list[Named]]:
        """The model with effects replaced by alternatives that are more probable beside all others.

        An effect selected first may have been a surrogate of one that was selected later.
        """
        kept, every = [], self.listed(best, present=True)
        for one in named:
            one, others = self._beside(best, every, one)
            tried = [(one.effect, best), *((rival, self._without(best, one, rival)) for rival in others)]
            tried = [(effect, model) for effect, model in tried if model.admissible] or tried[:1]
            values = robust_log_evidence(
                [-float(model.fit.cost) for _, model in tried], [m.predicted for _, m in tried]
            )
            fits = [(effect, model, value) for (effect, model), value in zip(tried, values, strict=True)]
            effect, model, _ = max(fits, key=lambda fit: (fit[1].significant, fit[2]))
            if model is best:
                kept.append(refitted(one, [(effect, value) for effect, _, value in fits]))
            else:
                best, every = model, self.listed(model, present=True)
                kept.append(self._beside(best, every, dataclasses.replace(one, effect=effect))[0])
        return best, kept

    def _without(self, best: Model, one: Named, *rival: AbstractEffect) -> Model:
        """The model without one effect, or with a rival in its place."""
        return self.by_innovations.replaced(self.start, best, one.effect.label, *rival)

    def _beside(self, best: Model, every: Selector, one: Named) -> tuple[Named, list[AbstractEffect]]:
        """The posterior probability of an effect beside all others of a model, and its rivals, the best first.

        By the linearisation without the effect, from `every`, which lists all candidates; or by a fit without it where
        the linearisation does not restore the evidence of the effect itself.
        """
        whole = every.evidence.best([])[0]
        selectors = (lambda: selector_without(every, one.effect), lambda: self.listed(self._without(best, one)))
        # differences between runs are no sum of columns that a linearisation could take away
        for make in selectors[isinstance(one.effect, RunVariation) :]:
            selector = make()
            scan = selector.scan([])
            own = [i for i, effect in enumerate(selector.candidates) if effect.label == one.effect.label]
            number = max(own, key=lambda i, value=scan.value: value[i])
            without, again = (selector.evidence.best(selector.columns(some))[0] for some in ([], [number]))
            if np.isfinite(scan.value[number]) and whole - again < (1.0 - settings.NEARLY_ALL) * (whole - without):
                break
        if not np.isfinite(scan.value[number]):
            return one, []
        close = scan.value > scan.value[number] - settings.CLEAR_LOG_BAYES
        close &= ~significant_beside(selector, [], number, scan)
        close[own] = False
        others: dict[str, AbstractEffect] = {}
        for i in (i for i in np.argsort(-scan.value) if close[i]):
            others.setdefault(scan.effects[i].label, scan.effects[i])
        return named_on(selector, [], number), [*others.values()][: settings.ALTERNATIVES]


def backward_eliminated(
    by_innovations: InnovationModels, start: Model, best: Model, named: Sequence[Named]
) -> tuple[Model, list[Named], dict[str, Comparison]]:
    """Backward elimination: the model with those of `named` that are accepted beside the others, and their gains."""
    while named and best.view.finite:
        gains = {one.effect.label: by_innovations.gain_by(best, one.effect) for one in named}
        p_values = {one.effect.label: p_value(best.view, one.effect) for one in named}
        # first of all what is not significant, then what is not accepted, the least gain first
        order = lambda label, gains=gains, p_values=p_values: (
            -max(p_values[label], settings.SIGNIFICANCE),
            gains[label].accepted,
            np.nan_to_num(gains[label].one_step.total),
        )
        worst = min(gains, key=order)
        if gains[worst].accepted and p_values[worst] < settings.SIGNIFICANCE:
            return best, [*named], gains
        named = [one for one in named if one.effect.label != worst]
        best = by_innovations.replaced(start, best, worst)
    return start, [], {}
