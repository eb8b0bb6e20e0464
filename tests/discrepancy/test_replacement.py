"""A coefficient of the baseline gives way to an effect that is another law of its force, where runs bear that out."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.discrepancy.accept.acceptance import fitted_model
from jaxsub.discrepancy.accept.verdict import NOTHING
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.search.replacement import with_replacement
from jaxsub.effects import QuadraticDamping
from jaxsub.estimate import batch, fit
from jaxsub.simulation import synthetic

BOTH = [(0.0, False), pytest.param(0.3, True, marks=pytest.mark.long)]


@pytest.mark.parametrize(("viscous", "stays"), BOTH)
def test_viscous_friction_stays_only_where_the_rig_has_it(viscous, stays):
    """Claim: beside square friction the viscous one is zero if the rig has none, and the square one is then surer."""
    truth = oscillator(coefficients={"D_x": viscous, "K_x": 4.6, "B_x_drive": 2.2})
    truth = truth.with_effect(QuadraticDamping("x", jnp.asarray(-0.4)))
    inputs = [driven(truth, 0.1 * np.arange(300), seed, amplitude=1.0) for seed in range(2)]
    effect = QuadraticDamping("x", jnp.asarray(-0.3))
    vehicle = oscillator().with_effect(effect)
    runs = batch(vehicle, synthetic(truth, inputs, seed=4))
    found = fit(vehicle, runs)
    model = fitted_model(found, look(found), (effect,))
    best, judged = with_replacement(lambda message: None, model, NOTHING)
    assert ("D_x" in best.fit.names) is stays
    label = "quadratic-damping[x].D2_x"
    assert abs(best.fit.values[label] + 0.4) < 3.0 * best.fit.standard_errors[label]
    if not stays:
        assert best.fit.vehicle.values()["D_x"] == 0.0
        assert best.fit.standard_errors[label] < 0.7 * found.standard_errors[label]
        assert {one.candidate for one in judged.decisions} == {"D_x beside quadratic-damping[x]"}
        assert {one.outcome for one in judged.decisions} == {"rejected", "held at zero"}
