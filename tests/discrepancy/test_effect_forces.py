"""The force of added effects by the recordings is the one that acts, whatever the improved model says it is."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded

from jaxsub.discrepancy.explain.effect_forces import effect_forces
from jaxsub.discrepancy.explain.locate import traces
from jaxsub.discrepancy.linearise.view import look
from jaxsub.effects import SensorScale
from jaxsub.effects.hull_damping import QuadraticDamping
from jaxsub.estimate import fit
from jaxsub.vehicle.catalogue import dsrv


def held(vehicle):
    """The vehicle with no number free."""
    rows = tuple(dataclasses.replace(row, free=False) for row in vehicle.layout.parameters)
    return dataclasses.replace(vehicle, layout=dataclasses.replace(vehicle.layout, parameters=rows))


@pytest.mark.long
def test_the_force_by_the_recordings_is_the_true_one_where_the_model_has_half_of_it():
    """Claim: in pitch it follows the true damping, M_qq q|q|, though the model's is half as large."""
    damping = lambda size: QuadraticDamping("pitch", jnp.asarray(size))
    runs = recorded(damping(-2e4), 5)[:1]
    # a damping of zero is none, and shares its programs with the other model
    baseline, improved = (look(fit(held(dsrv().with_effect(damping(size))), runs)) for size in (0.0, -1e4))
    assert effect_forces(baseline, improved, [SensorScale("q", jnp.asarray(0.05))]) is None
    (trace,) = traces(improved, runs, effect_forces(baseline, improved, [damping(-1e4)]))
    q = trace.states["q"]
    assert np.isnan(q[-1]) and trace.states.keys() >= {"w", "theta"}
    product = (q * np.abs(q))[:-1]
    np.testing.assert_allclose(trace.modelled["pitch"][:-1], -1e4 * product, rtol=1e-6, atol=1e-9)
    slope = product @ trace.recorded["pitch"][:-1] / (product @ product)
    assert -2.4e4 < slope < -1.6e4
