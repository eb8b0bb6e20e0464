"""Errors of simulations under random forces, against the covariance of all their samples written out."""

import jax.numpy as jnp
import numpy as np
from random_systems import random_system

from jaxsub.likelihood import Disturbance, open_loop_errors, propagate

RUNS, SAMPLES, STATES, FORCES, CHANNELS = 2, 9, 3, 2, 2


def test_errors_have_the_variance_of_the_response_that_no_initial_state_takes_up():
    """Claim: diag P M Σ Mᵀ P, Σ = q² e^(-|t - t'|/τ) of a force, M the response to it, P what a start leaves."""
    rng = np.random.default_rng(31)
    measured = rng.random((RUNS, SAMPLES, CHANNELS)) > 0.2
    system = random_system(rng, measured, STATES, FORCES)
    disturbance = Disturbance(jnp.array([2.0, 0.3]), jnp.array([0.4, 5.0]), jnp.ones(CHANNELS))
    # one column for each sample of each force
    force = np.eye(SAMPLES * FORCES).reshape(SAMPLES, FORCES, -1)
    pushed = jnp.asarray(np.broadcast_to(np.concatenate([force[:-1], force[1:]], axis=1), (RUNS, SAMPLES - 1, 4, 18)))
    response = system.C @ propagate(system.A, system.G @ pushed, jnp.zeros((RUNS, STATES, SAMPLES * FORCES)))
    each = jnp.broadcast_to(jnp.eye(STATES), (RUNS, STATES, STATES))
    begun = system.C @ propagate(system.A, jnp.zeros((RUNS, SAMPLES - 1, STATES, STATES)), each)
    times = np.pad(np.cumsum(np.asarray(system.intervals), axis=1), [(0, 0), (1, 0)])
    apart = np.abs(times[:, :, None] - times[:, None])
    covariance = np.zeros((RUNS, SAMPLES, FORCES, SAMPLES, FORCES))
    for i, (q, tau) in enumerate(zip(disturbance.force, disturbance.time, strict=True)):
        covariance[:, :, i, :, i] = q**2 * np.exp(-apart / tau)
    dense = covariance.reshape(RUNS, SAMPLES * FORCES, -1)
    M, start = (np.asarray(part).reshape(RUNS, SAMPLES * CHANNELS, -1) for part in (response, begun))
    left = np.stack([own - at @ np.linalg.pinv(at) @ own for own, at in zip(M, start, strict=True)])
    expected = np.einsum("rap,rpq,raq->ra", left, dense, left).reshape(RUNS, SAMPLES, CHANNELS)
    found = open_loop_errors(disturbance, system, rng.standard_normal((RUNS, SAMPLES, FORCES, 20000)))
    np.testing.assert_allclose(np.mean(found**2, axis=-1), expected, rtol=0.05, atol=1e-9)
    np.testing.assert_allclose(expected[~measured], 0.0, atol=1e-20)
