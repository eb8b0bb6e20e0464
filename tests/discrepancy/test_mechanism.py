"""A mechanism's friction is named for what it is: damping that differs by direction is neither offset nor dry."""

import math

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator
from scipy.signal import lfilter

from jaxsub.discrepancy import diagnose
from jaxsub.effects import AsymmetricDamping, CoulombFriction, CubicStiffness, QuadraticDamping, SmoothForce
from jaxsub.simulation import Sampled, synthetic

KINDS = (AsymmetricDamping, CoulombFriction, CubicStiffness, QuadraticDamping)


@pytest.mark.long
def test_damping_that_differs_by_direction_is_named():
    """Claim: named alone beside dry friction with an offset, within three errors; held-out runs are at the noise."""
    truth = oscillator().with_effect(AsymmetricDamping("x", jnp.asarray(0.15)))
    inputs = [driven(truth, 0.1 * np.arange(400), seed, amplitude=1.0) for seed in range(3)]
    runs = synthetic(truth, inputs, seed=4)
    wrong = oscillator(coefficients={"D_x": 0.5, "K_x": 4.6, "B_x_drive": 2.2})
    found, _ = diagnose(wrong, runs[:2], runs[2:], vocabulary=KINDS)
    assert (found.verdict, [one.effect for one in found.physics]) == ("named", ["asymmetric-damping"])
    size = found.physics[0].parameters["D_a"]
    assert abs(size.value - 0.15) < 3.0 * size.standard_error < 0.15
    held = found.fit["held_out"]
    assert max(held["improved"].values()) < 1.15 < max(held["baseline"].values())
    assert next(iter(found.kinds)) == "structure"


@pytest.mark.long
def test_a_spent_budget_gives_the_answer_so_far():
    """Claim: with no time for any fit the mismatch is there, incomplete and without a name; the test run is shown."""
    truth = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-0.4)))
    inputs = [driven(truth, 0.1 * np.arange(300), seed, amplitude=1.0) for seed in range(3)]
    runs = synthetic(truth, inputs, seed=4)
    found, _ = diagnose(oscillator(), runs[:2], runs[2:], vocabulary=(), budget=0.0)
    assert (found.complete, found.verdict, found.physics) == (False, "unknown", [])
    assert found.p_value < 1e-6 and any("incomplete" in note for note in found.notes)
    assert found.to_json()["complete"] is False and found.fit["held_out"]["baseline"]


@pytest.mark.long
def test_without_any_vocabulary_a_mismatch_is_modelled_and_has_no_name():
    """Claim: with no candidate at all a drag that is left out is unknown, and a smooth force takes it up."""
    truth = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-0.4)))
    inputs = [driven(truth, 0.1 * np.arange(300), seed, amplitude=1.0) for seed in range(3)]
    runs = synthetic(truth, inputs, seed=4)
    found, improved = diagnose(oscillator(), runs[:2], runs[2:], vocabulary=())
    assert (found.verdict, found.physics, found.candidates) == ("unknown", [], [])
    assert [type(effect) for effect in improved.effects] == [SmoothForce]
    assert found.explained is not None and found.explained.share is not None and found.explained.share > 0.9


@pytest.mark.long
def test_an_estimated_sigma_is_not_the_noise_where_forces_are_random():
    """Claim: of a rig pushed about at random, its σ estimated, the test error is told in sensor noise and not as noise.

    It is as large as random forces make it, so that nothing is missing.
    """
    truth = oscillator()
    times, rng = 0.1 * np.arange(400), np.random.default_rng(2)
    inputs = [driven(truth, times, seed, amplitude=1.0) for seed in range(3)]
    force = lfilter([1.0], [1.0, -math.exp(-0.1)], 0.4 * rng.standard_normal((3, len(times))))
    push = jnp.asarray(np.stack([force[:, :-1], force[:, 1:]], axis=2)[..., None])
    states = lambda vehicle, runs, start: Sampled.of(vehicle, runs).states(runs, start, push)
    runs = synthetic(truth, inputs, seed=4, states=states)
    unstated = oscillator(outputs={"x": {"sigma": "estimate"}, "x_rate": {"sigma": "estimate"}})
    found, _ = diagnose(unstated, runs[:2], runs[2:], vocabulary=())
    assert (found.verdict, found.physics) == ("none", []) and found.explained is not None
    assert "random disturbance forces leave" in found.summary and "to its noise" not in found.summary
    for channel, error in found.explained.left.items():
        assert error > 5.0
        assert 0.4 < error / found.explained.random[channel] < 2.0
    assert [*found.explained.left] == ["x", "x_rate"]
