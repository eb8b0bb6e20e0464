"""What no effect explains is modelled by a smooth force, beside which named effects keep or regain their numbers."""

import pytest
from diagnosis_cases import recorded, wrong
from lacking_rig import FITTER, KINDS, SPRING, lacking, models, numbers

from jaxsub.discrepancy.accept.model import fit_with
from jaxsub.discrepancy.accept.verdict import Judged
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.search.examine import examine
from jaxsub.discrepancy.search.surrogate import with_surrogate
from jaxsub.effects.hull import HullAsymmetry
from jaxsub.effects.hull_damping import QuadraticDamping
from jaxsub.estimate import batch, fit

FRICTION, FORCE = "coulomb-friction[x]", "smooth-force[x,x_rate]"
UNKNOWN = Judged("unknown", [], 1e-9, [])


def with_force(effect, *rig):
    """A model of an oscillator that damping drives, one `effect` accepted, and that model with a smooth force."""
    named = models(*rig).model(numbers(lacking(*rig)[1], effect))
    found = examine(named.view, KINDS, lambda message: None)
    assert found.nonparametric == "x"
    best, said = with_surrogate(FITTER, named, found, UNKNOWN, KINDS)
    assert FORCE in [one.label for one in best.added] and (said.verdict, said.named) == ("unknown", [])
    assert float(best.fit.cost) < 0.1 * float(named.fit.cost)
    return named, best


def test_a_named_effect_that_a_smooth_force_hides_keeps_its_numbers():
    """Claim: friction beside a smooth force of the rate, of which it is nearly a part, is held at what it was."""
    named, best = with_force(FRICTION, 0.15)
    values, kept = named.fit.vehicle.values(), best.fit.vehicle.values()
    own = [name for name in values if name.startswith(FRICTION)]
    assert own and not set(own) & set(best.fit.names)
    assert all(float(kept[name]) == float(values[name]) for name in own)


def test_a_named_effect_that_a_smooth_force_leaves_identifiable_is_estimated_again():
    """Claim: a spring beside a smooth force of the rate, unlike which it is, comes nearer to its true 1 N/m³."""
    named, best = with_force(SPRING, 0.15, 1.0)
    own = f"{SPRING}.k_3"
    before, after = (abs(float(one.fit.vehicle.values()[own]) - 1.0) for one in (named, best))
    assert own in best.fit.names and after < 0.5 * before


@pytest.mark.long
def test_numbers_that_are_held_stay_through_every_search():
    """Claim: a moment that is held is the same after a fit with a drag more, which starts at the file's numbers too."""
    runs = batch(wrong(), recorded(HullAsymmetry("pitch", 300.0), 2)[:2])
    vehicle = wrong().with_effect(HullAsymmetry("pitch", 250.0))
    own = next(row.name for row in vehicle.layout.free if row.name.startswith("hull-asymmetry"))
    found = fit(vehicle.holding([own]), runs)
    more = fit_with(look(found), found, [QuadraticDamping("heave", -1.0)], wrong())
    assert own not in more.names
    assert float(more.vehicle.values()[own]) == 250.0
    assert any(name.startswith("quadratic-damping") for name in more.names)
    assert float(more.cost) < float(found.cost)
