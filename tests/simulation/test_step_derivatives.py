"""The derivatives of a step that are put together from its stages are those of the step as a whole."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven, oscillator, stacked

from jaxsub.effects import FluidMemory, QuadraticDamping, RunVariation
from jaxsub.simulation import Sampled, Slopes, linearised_step
from jaxsub.vehicle.catalogue import nps_auv_ii


def remembering():
    """A body with a force that has a state of its own."""
    vehicle = nps_auv_ii().with_effect(QuadraticDamping("roll", jnp.asarray(-300.0)))
    return vehicle.with_effect(FluidMemory("sway", jnp.asarray(-2e3), jnp.asarray(3.0)))


def differing():
    """A mechanism whose damping and inertia differ by run."""
    vehicle = coupled().with_effect(RunVariation("D_a_b", spread=jnp.asarray(0.1)))
    return vehicle.with_effect(RunVariation("I_b", spread=jnp.asarray(0.2)))


CASES = {"memory": remembering, "by run": differing, "mechanism": oscillator}


def ready(vehicle, runs, theta):
    """The vehicle at the free numbers `theta`, ready to step, and the first interval's signals."""
    names = [row.name for row in vehicle.layout.free]
    model = Sampled.of(vehicle.with_values(dict(zip(names, theta, strict=True))), runs)
    return model, model.vehicle.actuate(runs.times[0], runs.nodes()[0])[3]


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("name", CASES)
def test_derivatives_are_those_of_the_step_in_forward_mode(name, substeps):
    vehicle, rng = CASES[name](), np.random.default_rng(5)
    runs = stacked(vehicle, [driven(vehicle, 0.3 * np.arange(6), seed=3, amplitude=0.3)])
    runs = dataclasses.replace(runs, substeps=substeps)
    s, n = len(vehicle.layout.states), len(vehicle.layout.equations)
    theta = jnp.stack([vehicle.values()[row.name] for row in vehicle.layout.free])
    state, push = jnp.asarray(0.1 * rng.standard_normal(s)), jnp.asarray(10.0 * rng.standard_normal((2, n)))
    index = runs.step_of[0, 3]

    def stepped(theta, state, push):
        model, nodes = ready(vehicle, runs, theta)
        return model.step(state, nodes, index, push)

    @jax.jit
    def linearised(theta, state, push):
        slope = lambda tangent: jax.jvp(lambda theta: ready(vehicle, runs, theta), (theta,), (tangent,))
        (model, nodes), slopes = jax.vmap(slope, out_axes=(None, 0))(jnp.eye(len(theta)))
        return linearised_step(model, state, nodes, index, push, Slopes(*slopes))

    found = linearised(theta, state, push)
    F, A, G = jax.jit(jax.jacfwd(stepped, (0, 1, 2)))(theta, state, push)
    np.testing.assert_allclose(found.after, stepped(theta, state, push), rtol=1e-12)
    for own, whole in ((found.A, A), (found.F, F), (found.G, G.reshape(s, -1))):
        size = np.abs(whole).max(axis=0) + 1e-300
        assert (np.abs(whole).max() > 0.0) and own.shape == whole.shape
        np.testing.assert_allclose(own / size, whole / size, atol=1e-12)
