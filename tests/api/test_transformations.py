"""`jax.jit`, `vmap` and `grad` take methods of what the front door gives as they are."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import oscillator

import jaxsub as js


@pytest.mark.parametrize("compiled", [jax.jit, eqx.filter_jit])
def test_a_plants_step_is_compiled_mapped_and_differentiated(compiled):
    """Claim: of the oscillator all agree with the step itself, and its slope by u with a difference."""
    plant = js.discretise(oscillator(), 0.1)
    x, u = jnp.array([0.3, -0.2]), jnp.array([0.5])
    after = plant.step(x, u)
    np.testing.assert_allclose(compiled(plant.step)(x, u), after, rtol=1e-12)
    np.testing.assert_allclose(jax.vmap(plant.step)(x[None], u[None])[0], after, rtol=1e-12)
    slope = jax.jit(jax.grad(lambda u: plant.step(x, u)[1]))(u)
    difference = (plant.step(x, u + 1e-4)[1] - plant.step(x, u - 1e-4)[1]) / 2e-4
    np.testing.assert_allclose(slope[0], difference, rtol=1e-6)
    np.testing.assert_allclose(jax.jit(plant.jacobians)(x, u).B[1, 0], difference, rtol=1e-6)


def test_a_vehicle_is_an_argument_and_its_methods_are_compiled():
    """Claim: the acceleration -D v - K x + B f follows a vehicle's numbers through `jit` and `grad`."""
    vehicle = oscillator()
    state, signals = jnp.array([0.3, -0.2]), jnp.array([0.5])
    expected = -0.6 * 0.3 + 4.0 * 0.2 + 2.0 * 0.5
    np.testing.assert_allclose(jax.jit(vehicle.acceleration)(state, signals), [expected], rtol=1e-12)
    of = jax.jit(lambda vehicle: vehicle.acceleration(state, signals)[0])
    np.testing.assert_allclose(of(vehicle), expected, rtol=1e-12)
    slope = jax.grad(lambda damping: of(vehicle.with_values({"D_x": damping})))(0.6)
    np.testing.assert_allclose(slope, -0.3, rtol=1e-12)
