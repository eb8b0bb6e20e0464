"""The sampled step is exact for a linear vehicle under held inputs, and of order four for the rest of a vehicle."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven, oscillator, stacked
from scipy.linalg import expm

from jaxsub.effects import ActuatorDelay, ActuatorLag, CoriolisCoupling, CubicStiffness
from jaxsub.recording import Recording
from jaxsub.simulation import at_rest, integrate, sampled_states
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii

EVEN = 2.0 * np.arange(12)
UNEVEN = np.cumsum(np.random.default_rng(3).uniform(0.01, 4.0, 12))


def floating_free(vehicle):
    """Without restoring moments, and so linear in the velocities."""
    return vehicle.with_values(dict.fromkeys(("x_B", "y_B", "z_B"), jnp.zeros(())))


def undamped():
    """With an A that is singular."""
    gone = ("X_u", "K_v", "K_p", "K_r", "M_w", "M_q")
    return floating_free(nps_auv_ii()).with_values(dict.fromkeys(gone, jnp.zeros(())))


@pytest.mark.parametrize("times", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("make", [dsrv, lambda: floating_free(nps_auv_ii()), undamped], ids=["dsrv", "nps", "singular"])
def test_velocities_of_a_linear_vehicle_are_exact_whatever_the_step(make, times):
    vehicle = make()
    recording = driven(vehicle, times, seed=1, hold=2)
    runs = stacked(vehicle, [recording])
    states = sampled_states(vehicle, runs, at_rest(vehicle, 1))[0]
    n = len(vehicle.layout.equations)
    inverse = np.linalg.inv(vehicle.mass_matrix())
    A = inverse @ vehicle.damping_matrix()
    velocity = np.asarray(at_rest(vehicle, 1))[0, :n]
    for k, dt in enumerate(np.diff(recording.times)):
        still = jnp.zeros(len(at_rest(vehicle, 1)[0]))
        force = inverse @ vehicle.force(vehicle.motion(still, runs.signals[0, k]))
        block = np.zeros((n + 1, n + 1))
        block[:n, :n], block[:n, n] = A * dt, force * dt
        velocity = (expm(block) @ np.append(velocity, 1.0))[:n]
        np.testing.assert_allclose(states[k + 1, :n], velocity, rtol=1e-10, atol=1e-12)


def test_error_falls_with_the_fourth_power_of_the_step():
    vehicle = nps_auv_ii().with_effect(CoriolisCoupling(nps_auv_ii().layout.equations, jnp.asarray(1.0)))
    runs = stacked(vehicle, [driven(vehicle, 1.0 * np.arange(8), seed=2, amplitude=0.3, hold=2)])
    start = at_rest(vehicle, 1).at[0, 6:9].set(jnp.array([0.2, -0.1, 0.3]))
    truth = integrate(vehicle, runs, start, rtol=1e-13, atol=1e-13)
    parts = np.array([1, 2, 4])
    size = []
    for substeps in parts:
        states = sampled_states(vehicle, dataclasses.replace(runs, substeps=int(substeps)), start)
        size.append(np.sqrt(np.mean((states - truth) ** 2)))
    slope = -np.polyfit(np.log(parts), np.log(size), 1)[0]
    assert 3.6 < slope < 4.6
    assert size[-1] < 1e-4


@pytest.mark.parametrize("effect", [ActuatorLag("drive", 0.3), ActuatorDelay("drive", 0.25), CubicStiffness("x", 8.0)])
def test_an_effect_does_the_same_in_the_sampled_and_the_continuous_model(effect):
    vehicle = oscillator().with_effect(effect)
    runs = stacked(vehicle, [driven(vehicle, 0.02 * np.arange(120), seed=4, amplitude=1.0)])
    start = jnp.array([[0.3, -0.2]])
    sampled, continuous = sampled_states(vehicle, runs, start), integrate(vehicle, runs, start)
    np.testing.assert_allclose(sampled, continuous, atol=1e-6)
    plain = sampled_states(oscillator(), runs, start)
    assert np.abs(sampled - plain).max() > 1e-2


@pytest.mark.parametrize("states", [sampled_states, integrate])
def test_padding_changes_nothing_in_a_shorter_run(states):
    vehicle = coupled()
    short, long = (driven(vehicle, 0.1 * np.arange(samples), seed=5, amplitude=1.0) for samples in (20, 33))
    start = jnp.array([[0.1, 0.0, 0.2, 0.0], [0.0, 0.3, 0.0, 0.1]])
    together = states(vehicle, stacked(vehicle, [short, long]), start)
    for index, recording in enumerate((short, long)):
        alone = states(vehicle, stacked(vehicle, [recording]), start[index : index + 1])[0]
        np.testing.assert_allclose(together[index, : len(alone)], alone, rtol=1e-13, atol=1e-14)
    np.testing.assert_array_equal(together[0, 20:], np.broadcast_to(together[0, 19], (13, 4)))


@pytest.mark.parametrize(("states", "tolerance"), [(integrate, 1e-7), (sampled_states, 1e-5)])
def test_uneven_samples_of_a_run_give_the_states_at_the_times_they_share(states, tolerance):
    vehicle = coupled()
    full = driven(vehicle, 0.01 * np.arange(90), seed=6, amplitude=1.0, hold=6)
    keep = (np.arange(90) % 6 == 0) | (np.random.default_rng(6).random(90) < 0.3)
    few = Recording("few", full.times[keep], {name: c[keep] for name, c in full.columns.items()}, "few")
    start = jnp.array([[0.1, 0.0, 0.2, 0.0]])
    every, some = (states(vehicle, stacked(vehicle, [recording]), start)[0] for recording in (full, few))
    assert len(np.unique(np.round(np.diff(few.times), 9))) > 3
    np.testing.assert_allclose(some, every[keep], atol=tolerance)
