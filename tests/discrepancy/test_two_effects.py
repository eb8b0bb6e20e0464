"""A rig that lacks two effects: what explains its simulation error, and what joins the model without a name."""

import dataclasses
from functools import cache

import jax.numpy as jnp
import numpy as np
from rigs import driven, oscillator

from jaxsub.discrepancy.accept.acceptance import (
    Examination,
    Model,
    ModelFitter,
    dominant,
    fitted_model,
    proposed_effects,
)
from jaxsub.discrepancy.accept.verdict import Judged
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.linearise.whiteness import Memory
from jaxsub.discrepancy.records.progress import OutOfTime
from jaxsub.discrepancy.search.examine import listed, weighed
from jaxsub.discrepancy.search.surrogate import most_explaining, with_surrogate
from jaxsub.effects import CubicDamping, CubicStiffness, QuadraticDamping, SensorScale
from jaxsub.estimate import batch, fit
from jaxsub.simulation import synthetic

KINDS = (CubicDamping, CubicStiffness, QuadraticDamping, SensorScale)
UNKNOWN = Judged("unknown", [], 1e-9, [])
DRAG, SPRING = "quadratic-damping[x]", "cubic-stiffness[x]"


@cache
def lacking() -> tuple[Model, Examination]:
    """The fit without a quadratic drag and a cubic spring, and its examination, as if all names had been rejected."""
    truth = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-0.4)))
    truth = truth.with_effect(CubicStiffness("x", jnp.asarray(1.0)))
    inputs = [driven(truth, 0.1 * np.arange(200), seed, amplitude=1.0) for seed in range(2)]
    found = fit(oscillator(), batch(oscillator(), synthetic(truth, inputs, seed=4)))
    view = look(found)
    seen = weighed(view, listed(view, KINDS), lambda message: None)
    return fitted_model(found, view, ()), dataclasses.replace(seen, pattern=None, memory=Memory(1e-9, 1.0))


def usable(*left_out: str) -> Examination:
    """The examination with all candidates but some."""
    _, found = lacking()
    found.selector.by_simulation.clear()
    found.selector.usable[:] = [effect.label not in left_out for effect in found.selector.candidates]
    return found


@dataclasses.dataclass(frozen=True)
class Fitter(ModelFitter):
    """Which terms were fitted together; where `astray` is among several, its fit ends with the sign turned.

    After as many fits as `most` the time is out.
    """

    astray: str = "none"
    most: int = 9
    asked: list[list[str]] = dataclasses.field(default_factory=list)

    def with_effects(self, model, effects, disturbance, near=()):
        if len(self.asked) == self.most:
            raise OutOfTime
        self.asked.append([effect.label for effect in effects])
        more = super().with_effects(model, effects, disturbance, near)
        if len(effects) == 1 or self.astray not in self.asked[-1]:
            return more
        vehicle = more.fit.vehicle
        turned = {name: -value for name, value in vehicle.values().items() if name.startswith(self.astray)}
        return more._replace(fit=dataclasses.replace(more.fit, vehicle=vehicle.with_values(turned)))


def test_what_moves_the_rig_explains_its_simulation_error():
    """Claim: by share, both that it lacks and no twin beside them; a twin in place of one; a scale error never."""
    labels = lambda found: [effect.label for effect in most_explaining(found.selector, found.selector.simulation)]
    found = usable()
    explained = found.selector.simulation.explained([], found.selector.owners)
    share = dict(zip([one.label for one in found.selector.candidates], explained, strict=True))
    assert sorted([DRAG, SPRING], key=lambda label: -share[label]) == labels(found)
    assert labels(usable(DRAG))[:1] == ["cubic-damping[x]"]
    assert share["sensor-scale[x]"] > 0.05 and labels(usable(DRAG, SPRING, "cubic-damping[x]")) == []


def test_what_explains_most_of_a_simulation_error_is_proposed_where_all_are_rejected():
    """Claim: the drag is, and its twin may stand for it, a scale error not; without it its twin yields to any force."""
    found = usable()
    labels = [effect.label for effect in found.selector.candidates]
    assert [labels[i] for i in proposed_effects(found, UNKNOWN)] == [DRAG]
    may = dict(zip(labels, found.selector.alternatives_to([], labels.index(DRAG)), strict=True))
    assert may["cubic-damping[x]"] and not may["sensor-scale[x]"]
    assert proposed_effects(usable(DRAG), UNKNOWN) == []


def test_an_effect_whose_evidence_is_nearly_that_of_all_is_fitted_first():
    """Claim: neither of the two is, and either is beside a scale error that is not there."""
    selector = usable().selector
    number = {effect.label: i for i, effect in enumerate(selector.candidates)}
    assert dominant(selector, [number[DRAG], number[SPRING]]) == []
    for label in (DRAG, SPRING):
        assert dominant(selector, [number["sensor-scale[x_rate]"], number[label]]) == [number[label]]


def test_what_has_no_name_joins_as_surrogate_terms_where_something_is_left():
    """Claim: both join, simulation costs a fifth, nothing is named; where white innovations are left nothing joins."""
    named, _ = lacking()
    fitter = Fitter(lambda message: None, oscillator())
    best, said = with_surrogate(fitter, named, usable(), UNKNOWN, KINDS)
    assert {effect.label for effect in best.added[:2]} == {DRAG, SPRING}
    assert float(best.fit.cost) < 0.2 * float(named.fit.cost)
    assert (said.verdict, said.named) == ("unknown", [])
    assert DRAG in said.notes[0] and SPRING in said.notes[0]
    nothing_left = dataclasses.replace(usable(), memory=Memory(1.0, 1.0))
    assert with_surrogate(fitter, named, nothing_left, UNKNOWN, KINDS) == (named, UNKNOWN)


def test_of_terms_fitted_together_only_the_inadmissible_are_left_out():
    """Claim: where the drag's fit ends with a sign that drives, the spring is tried without it and without others."""
    named, _ = lacking()
    fitter = Fitter(lambda message: None, oscillator(), DRAG, most=2)
    best, said = with_surrogate(fitter, named, usable(), UNKNOWN, KINDS)
    assert [sorted(labels) for labels in fitter.asked] == [[SPRING, DRAG], [SPRING]]
    assert (best, said.complete) == (named, False)
