"""Which of the proposed effects are accepted: alone, together, beside earlier ones, and in whose place."""

import dataclasses

import numpy as np
import pytest
from lacking_rig import CUBIC, DRAG, FITTER, SPRING, labels, lacking, models, numbers

from jaxsub.discrepancy.accept.acceptance import CandidateModels, accept_jointly, accept_singly
from jaxsub.discrepancy.accept.verdict import Judged
from jaxsub.discrepancy.propose.name import Named
from jaxsub.discrepancy.search.structure_search import without_redundant
from jaxsub.effects import CubicDamping, QuadraticDamping

FRICTION, SCALE = "coulomb-friction[x]", "sensor-scale[x]"
BOTH, DAMPED, DRIVING = (-0.4, 1.0), (-0.4,), (0.15,)


def singly(rig, *chosen):
    """What is accepted by itself, with the rivals that were fitted, best first."""
    known = models(*rig)
    kept = accept_singly(known, numbers(known.found, *chosen))
    return {labels(known.found, [i])[0]: labels(known.found, [j for j, _ in fits]) for i, fits in kept.items()}


def test_the_most_probable_of_collinear_effects_is_accepted():
    """Claim: beside a spring that is missing too, of two laws of damping one, whichever is proposed; else none."""
    (first, second) = singly(BOTH, DRAG), singly(BOTH, CUBIC)
    assert first == second and sorted(*first.values()) == [CUBIC, DRAG]
    known = models(*BOTH)
    evidence = {label: known.log_evidence(numbers(known.found, label)) for label in (DRAG, CUBIC)}
    assert [*first] == [max(evidence, key=lambda label: evidence[label])]
    assert singly(BOTH, SCALE) == {}


def test_an_inadmissible_effect_gives_way_to_its_rivals():
    """Claim: of damping that drives, the next by evidence is accepted, and its fit has none: minus infinity."""
    found = singly(DRIVING, DRAG)
    known = models(*DRIVING)
    assert [*found] == [FRICTION] and found[FRICTION][-1] == DRAG
    assert known.log_evidence(numbers(known.found, DRAG)) == -np.inf


def test_an_insignificant_effect_has_evidence():
    """Claim: a spring that is not there has less evidence than the drag that is, and is not accepted."""
    known = models(*DAMPED)
    (drag, spring) = numbers(known.found, DRAG, SPRING)
    assert not known.is_significant([spring]) and known.is_significant([drag])
    assert -np.inf < known.log_evidence([spring]) < known.log_evidence([drag])
    assert singly(DAMPED, SPRING) == {} and [*singly(DAMPED, DRAG)] == [DRAG]


@pytest.mark.parametrize(("rig", "expected"), [(BOTH, {DRAG, SPRING}), (DAMPED, {DRAG}), (DRIVING, set())])
def test_of_effects_fitted_together_those_that_are_there_are_accepted(rig, expected):
    """Claim: two of four where two are missing, one of two that are correlated, none where none is admissible."""
    known = models(*rig)
    kept = accept_jointly(known, numbers(known.found, DRAG, CUBIC, SPRING, SCALE))
    assert set(labels(known.found, [*kept])) == expected


def test_a_fit_of_fewer_effects_starts_where_that_of_more_ended():
    """Claim: at the fitted numbers of what remains; the first fit, which none had more than, has no such start."""
    base, found = lacking(*DAMPED)
    starts = []

    def make(model, effects, disturbance, near=()):
        starts.append(near)
        return FITTER.with_effects(model, effects, disturbance, near)

    known, (drag, spring) = CandidateModels(make, base, found), numbers(found, DRAG, SPRING)
    more = known.model([drag, spring]).fit.vehicle.values()
    known.model([drag])
    first, (fewer,) = starts
    assert [*first] == [] and [effect.label for effect in fewer.effects] == [DRAG]
    assert all(value == more[name] for name, value in fewer.values().items())


def test_an_earlier_effect_that_a_newer_one_makes_redundant_is_dropped():
    """Claim: cubic damping beside the quadratic that is there, with its name; not the quadratic beside the cubic."""
    base, found = lacking(*DAMPED)
    added = [CubicDamping("x", -0.2), QuadraticDamping("x", -0.3)]
    both = FITTER.with_effects(base, added, found.naming.products.disturbance)
    cubic, drag = both.added
    judged = Judged("named", [Named(i, effect, 1.0, [], []) for i, effect in enumerate(both.added)], 1e-9, [])
    fewer, after = without_redundant(FITTER, base, both, judged, [cubic])
    assert [effect.label for effect in fewer.fit.vehicle.all_effects] == [DRAG]
    assert [one.effect.label for one in after.named] == [DRAG] and len(after.notes) == 1
    assert without_redundant(FITTER, base, both, judged, [drag]) == (both, dataclasses.replace(judged))
