"""What the structure search does where linearisation, or a fit in simulation, misleads."""

import dataclasses

import pytest
from lacking_rig import DRAG, FITTER, KINDS, lacking
from rigs import oscillator

from jaxsub.discrepancy.accept.acceptance import ModelFitter
from jaxsub.discrepancy.accept.verdict import judge
from jaxsub.discrepancy.search.examine import examine
from jaxsub.discrepancy.search.structure_search import reconsidered, search_structure
from jaxsub.effects import SensorScale


@dataclasses.dataclass(frozen=True)
class Diverted(ModelFitter):
    """A fitter whose fits in simulation end with the signs of what they add turned; it keeps what was fitted."""

    fitted: list[list[str]] = dataclasses.field(default_factory=list)

    def with_effects(self, model, effects, disturbance, near=()):
        more = super().with_effects(model, effects, disturbance, near)
        self.fitted.append([effect.label for effect in effects])
        values = more.fit.vehicle.values()
        turned = {name: -value for name, value in values.items() if name.startswith(tuple(self.fitted[-1]))}
        return more._replace(fit=dataclasses.replace(more.fit, vehicle=more.fit.vehicle.with_values(turned)))


def test_where_fits_in_simulation_mislead_an_effect_is_found_by_innovations():
    """Claim: its fit is rejected once; by innovations it is found, and then accepted in simulation."""
    fitter = Diverted(lambda message: None, oscillator())
    model, said, _ = search_structure(fitter, *lacking(-0.4), KINDS)
    assert fitter.fitted == [[DRAG]]
    assert (said.verdict, [one.effect.label for one in said.named]) == ("named", [DRAG])
    assert float(model.fit.vehicle.values()[f"{DRAG}.D2_x"]) == pytest.approx(-0.4, rel=0.1)


def test_a_mismatch_that_no_candidate_explains_is_unknown():
    """Claim: damping that drives, which physics forbids each candidate, is unknown, significant, and left to model."""
    base, found = lacking(0.15)
    model, said, left = search_structure(FITTER, base, found, KINDS)
    assert (said.verdict, said.named, model) == ("unknown", [], base)
    assert said.p_value < 1e-6 and left is not None


def test_a_vocabulary_without_the_effect_leaves_it_unknown():
    """Claim: with scale errors of sensors alone, a missing drag is neither named nor called nothing."""
    base, _ = lacking(-0.4)
    found = examine(base.view, (SensorScale,), lambda message: None)
    _, said, _ = search_structure(FITTER, base, found, (SensorScale,))
    assert (said.verdict, said.named) == ("unknown", [])


def test_a_name_that_leaves_a_force_in_its_place_is_rejected_after_its_fit():
    """Claim: friction in the place of damping that drives is fitted, leaves a force in x, and is not taken."""
    base, found = lacking(0.15)
    judged = judge(found.naming, found.pattern, found.memory)
    assert (judged.verdict, found.nonparametric) == ("unknown", "x")
    assert reconsidered(FITTER, base, found, judged, KINDS) == (base, judged, None)
