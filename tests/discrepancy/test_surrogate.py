"""What has no name is described by what free runs ask for, and what was named keeps its numbers."""

import dataclasses
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_cases import recorded, wrong

from jaxsub.discrepancy.acceptance import Examination, Model, ModelFitter
from jaxsub.discrepancy.cross_validation import Comparison, Gain
from jaxsub.discrepancy.model import fit_with
from jaxsub.discrepancy.nonparametric import Pattern
from jaxsub.discrepancy.products import Products
from jaxsub.discrepancy.selector import Selector
from jaxsub.discrepancy.surrogate import with_surrogate
from jaxsub.discrepancy.verdict import Judged
from jaxsub.discrepancy.view import look
from jaxsub.discrepancy.whiteness import RANDOM, Memory
from jaxsub.effects import SmoothForce
from jaxsub.effects.hull import HullAsymmetry
from jaxsub.effects.hull_damping import QuadraticDamping
from jaxsub.estimate import batch, fit

NO_GAIN = Gain(0.0, 1.0, 1.0)


class FreeRun(Products):
    """Shares of a free run's errors that candidates explain on top of others."""

    def __init__(self, shares):
        object.__setattr__(self, "shares", shares)

    def explained(self, chosen, owners):
        return np.array(self.shares[len(chosen)])


class Freely(Selector):
    """What surrogates ask of a selector: shares of a free run's errors on top of others."""

    def __init__(self, candidates, shares, disturbance=None):
        self.candidates, self.usable = candidates, np.ones(len(candidates), bool)
        self.owners = [[i] for i in range(len(candidates))]
        self.free = FreeRun(shares)
        best = lambda columns: (0.0, SimpleNamespace(disturbance=disturbance))
        self.evidence = SimpleNamespace(best=best, given=[])
        self.predicted = lambda chosen, index, under: (candidates[index], True)


def seen(selector, memory, pattern=None, disturbance=None):
    """A last look at recordings, of which only the selector, what is left and a force without a name matter."""
    found = object.__new__(Examination)
    naming = SimpleNamespace(products=SimpleNamespace(disturbance=disturbance))
    parts = {"naming": naming, "pattern": pattern, "memory": memory, "view": None, "selector": selector}
    for name, value in parts.items():
        object.__setattr__(found, name, value)
    return found


@pytest.mark.parametrize(
    ("most", "worse", "asked", "stands"),
    [
        (9.0, 0.0, [8.0], 8.0),
        (5.0, 0.0, [8.0, 4.0], 4.0),
        (1.0, 0.0, [8.0, 4.0, 2.0], None),
        (3.0, 1.0, [8.0, 4.0], None),
    ],
)
def test_a_force_that_overdoes_it_is_tried_by_halves(monkeypatch, most, worse, asked, stands):
    """Claim: of a force found to be 8 N from zero half and a quarter are tried, and the largest that helps stands.

    Where free runs err more with half of it a quarter is not tried.
    """
    force = SmoothForce("surge", "u", -1.0, 1.0, 8.0)
    pattern = Pattern(force, np.zeros(2), 1.0, 1e-9, True, 0.0, 0.0)
    found = fit(wrong(), batch(wrong(), recorded(None, 2)[:2]))
    named = Model(found, look(found), None, ())
    spreads = []

    def fitted(fitter, model, effects, disturbance):
        spreads.append(effects[0].spread)
        return model._replace(predicted=effects[0].spread, added=tuple(effects))

    def gained(before, after, admissible):
        return Comparison(Gain(1.0, 1e-3 if after < most else 1.0, 0.5), NO_GAIN, 1.0 + worse / after, admissible)

    monkeypatch.setattr(ModelFitter, "with_effects", fitted)
    path = sys.modules["jaxsub.discrepancy.surrogate"]
    monkeypatch.setattr(path, "compare", gained)
    fitter = object.__new__(ModelFitter)
    left = seen(Freely([], [()]), Memory(1e-9, 1.0), pattern, named.view.disturbance)
    best, said = with_surrogate(fitter, named, left, Judged("unknown", [], 1e-9, []), None)
    assert spreads == asked
    assert [effect.spread for effect in best.added] == ([] if stands is None else [stands])
    assert (best is named) is (stands is None)
    assert [force.label in note for note in said.notes] == [True]


@pytest.mark.parametrize(("errors", "holds"), [(1.5, False), (3.0, True)])
def test_what_was_named_keeps_its_numbers_beside_what_hides_them(monkeypatch, errors, holds):
    """Claim: a named moment is fitted again beside a drag, unless its standard error then grows more than twofold."""
    effect, drag = HullAsymmetry("pitch", 250.0), QuadraticDamping("surge", -1.0)
    found = fit(wrong().with_effect(effect), batch(wrong(), recorded(effect, 2)[:2]))
    named = Model(found, look(found), None, (effect,))
    own = next(name for name in found.names if name.startswith("hull-asymmetry"))
    started = []

    def fitted(fitter, model, effects, disturbance):
        row = next(row for row in model.fit.vehicle.layout.parameters if row.name == own)
        started.append(row.free)
        cheaper = dataclasses.replace(found, cost=0.5 * found.cost, covariance=errors**2 * found.covariance)
        return model._replace(fit=cheaper, added=(*model.added, *effects))

    monkeypatch.setattr(ModelFitter, "with_effects", fitted)
    path = sys.modules["jaxsub.discrepancy.surrogate"]
    monkeypatch.setattr(path, "with_coloured_errors", lambda view, fit: fit)
    monkeypatch.setattr(path, "compare", lambda *given: Comparison(Gain(1.0, 1e-3, 0.999), NO_GAIN, 0.5, True))
    monkeypatch.setattr(path, "listed", lambda *_: Freely([], [()]))
    monkeypatch.setattr(path, "weighed", lambda *_: seen(None, RANDOM))
    selector = Freely([drag], [(0.3,), (0.0,)], named.view.disturbance)
    fitter = object.__new__(ModelFitter)
    object.__setattr__(fitter, "progress", lambda message: None)
    best, _ = with_surrogate(fitter, named, seen(selector, Memory(1e-9, 1.0)), Judged("named", [], 1e-9, []), None)
    assert best.added == (effect, drag)
    assert started == [True, False][: 1 + holds]


@pytest.mark.long
def test_numbers_that_are_held_stay_through_every_search():
    """Claim: a moment that is held is the same after a fit with a drag more, which begins at the file's numbers too."""
    runs = batch(wrong(), recorded(HullAsymmetry("pitch", 300.0), 2)[:2])
    vehicle = wrong().with_effect(HullAsymmetry("pitch", 250.0))
    own = next(row.name for row in vehicle.layout.free if row.name.startswith("hull-asymmetry"))
    found = fit(vehicle.holding([own]), runs)
    more = fit_with(look(found), found, [QuadraticDamping("heave", -1.0)], wrong())
    assert own not in more.names
    assert float(more.vehicle.values()[own]) == 250.0
    assert any(name.startswith("quadratic-damping") for name in more.names)
    assert float(more.cost) < float(found.cost)
