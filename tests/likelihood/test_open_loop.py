"""The spread of a simulation's error under random forces, against the covariance of all their samples written out."""

import jax.numpy as jnp
import numpy as np

from jaxsub.likelihood import Disturbance, System, open_loop_variance, propagate

RUNS, SAMPLES, STATES, FORCES, CHANNELS = 2, 9, 3, 2, 2


def test_the_variance_is_that_of_the_response_to_all_forces():
    """Claim: diag M Σ Mᵀ, Σ = q² e^(-|t - t'|/τ) of a force's samples, M the response to them from a known start."""
    rng = np.random.default_rng(31)
    measured = rng.random((RUNS, SAMPLES, CHANNELS)) > 0.2
    system = System(
        A=jnp.asarray(0.6 * rng.standard_normal((RUNS, SAMPLES - 1, STATES, STATES))),
        G=jnp.asarray(rng.standard_normal((RUNS, SAMPLES - 1, STATES, 2 * FORCES))),
        C=jnp.asarray(rng.standard_normal((RUNS, SAMPLES, CHANNELS, STATES)) * measured[..., None]),
        measured=jnp.asarray(measured),
        intervals=jnp.asarray(rng.uniform(0.1, 0.5, (RUNS, SAMPLES - 1))),
        start_std=jnp.ones(STATES),
    )
    disturbance = Disturbance(jnp.array([2.0, 0.3]), jnp.array([0.4, 5.0]), jnp.ones(CHANNELS))
    # one column for each sample of each force
    force = np.eye(SAMPLES * FORCES).reshape(SAMPLES, FORCES, -1)
    pushed = jnp.asarray(np.broadcast_to(np.concatenate([force[:-1], force[1:]], axis=1), (RUNS, SAMPLES - 1, 4, 18)))
    start = jnp.zeros((RUNS, STATES, SAMPLES * FORCES))
    response = np.asarray(system.C @ propagate(system.A, system.G @ pushed, start))
    times = np.pad(np.cumsum(np.asarray(system.intervals), axis=1), [(0, 0), (1, 0)])
    apart = np.abs(times[:, :, None] - times[:, None])
    covariance = np.zeros((RUNS, SAMPLES, FORCES, SAMPLES, FORCES))
    for i, (q, tau) in enumerate(zip(disturbance.force, disturbance.time, strict=True)):
        covariance[:, :, i, :, i] = q**2 * np.exp(-apart / tau)
    dense = covariance.reshape(RUNS, SAMPLES * FORCES, -1)
    expected = np.einsum("rkcp,rpq,rkcq->rkc", response, dense, response)
    np.testing.assert_allclose(open_loop_variance(disturbance, system), expected, atol=1e-12)
    assert not np.any(expected[~measured])
