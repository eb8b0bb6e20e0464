"""Steps are as short as what moves fast asks: fast damping is followed, a roll is exact enough, and no more is done."""

import dataclasses
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

from jaxsub.discrepancy.accept.acceptance import ModelFitter, fitted_model
from jaxsub.discrepancy.linearise.view import look
from jaxsub.effects import CubicStiffness, QuadraticDamping
from jaxsub.effects.memory import Hysteresis
from jaxsub.estimate import batch, evaluate, fit, gauss_newton, initial_guess
from jaxsub.estimate.integration_steps import FINEST, fastest, substeps_for, substeps_unseen
from jaxsub.simulation import simulate, synthetic
from jaxsub.simulation.synthesis import integrate
from jaxsub.vehicle import vehicle_from, with_coefficients


@pytest.fixture(scope="module")
def fitted():
    vehicle = oscillator()
    runs = synthetic(vehicle, [driven(vehicle, 0.1 * np.arange(200), seed, amplitude=1.0) for seed in range(2)], seed=1)
    return fit(vehicle, runs)


def test_the_fastest_rate_is_that_of_the_steepest_sample(fitted):
    """Claim: of D2 |v| v it is 2 |D2| times the largest speed over the inertia; a spring adds none."""
    motion = look(fitted).path.start
    vehicle = oscillator().with_effect(CubicStiffness("x", jnp.asarray(3.0)))
    assert fastest(vehicle, motion) == 0.0
    vehicle = vehicle.with_effect(QuadraticDamping("x", jnp.asarray(-5.0)))
    inertia = float(vehicle.mass_matrix()[0, 0])
    steepest = 2.0 * 5.0 * float(np.max(np.abs(motion.rates["x"]))) / inertia
    assert fastest(vehicle, motion) == pytest.approx(steepest, rel=1e-3)


def test_a_run_is_stepped_as_finely_as_its_damping_asks_and_no_finer(fitted):
    """Claim: none for what is slow, enough for a rate of 55 1/s at 0.1 s, and never more than the most."""
    motion = look(fitted).path.start
    largest = float(np.max(np.abs(motion.rates["x"])))
    inertia = float(oscillator().mass_matrix()[0, 0])
    damping = lambda rate: QuadraticDamping("x", jnp.asarray(-inertia * rate / (2.0 * largest)))
    steps = [substeps_for(oscillator().with_effect(damping(r)), fitted.runs, motion) for r in (1.0, 20.0, 55.0, 1e4)]
    assert steps == [1, 1, 4, FINEST]


@pytest.mark.long
def test_with_the_steps_that_it_asks_for_fast_damping_is_followed_to_the_noise():
    """Claim: damping of 25 1/s leaves the noise at eight steps in 0.2 s; at one half as much more, or no number."""
    truth = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-40.0)))
    inputs = [driven(truth, 0.2 * np.arange(200), seed, amplitude=2.0) for seed in range(2)]
    runs = batch(truth, synthetic(truth, inputs, seed=2, states=integrate))
    wrong = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-30.0)))
    by = lambda n: fit(wrong, dataclasses.replace(runs, substeps=n), method=gauss_newton())
    one, eight = (max(by(n).rms.values()) for n in (1, 8))
    assert eight < 1.1
    assert not one < 1.5


def bending(x_y=0.1):
    return oscillator().with_effect(Hysteresis("x", jnp.asarray(0.5), jnp.asarray(x_y)))


@cache
def bent():
    """Runs of an oscillator whose friction bends within a sample of 0.2 s, by SciPy's integrator."""
    inputs = [driven(bending(), 0.2 * np.arange(300), seed, amplitude=2.0) for seed in range(3)]
    return tuple(synthetic(bending(), inputs, seed=2, states=integrate))


@pytest.mark.long
def test_steps_are_halved_until_noise_hides_the_difference():
    """Claim: of a hysteresis one step a sample is off by several times the noise and those taken by less than a
    fortieth; without a state, or with a thousand times the noise, they are as they were; one that diverges is cured."""
    vehicle = bending()
    one = dataclasses.replace(batch(vehicle, bent()), substeps=1)
    start, sigma = initial_guess(vehicle, one)[0], jnp.array([output.sigma for output in vehicle.layout.outputs])
    steps = substeps_unseen(vehicle, one, start, sigma)
    assert batch(vehicle, bent()).substeps == steps > 1
    exact = simulate(vehicle, dataclasses.replace(one, substeps=4 * FINEST), start)
    off = lambda n: simulate(vehicle, dataclasses.replace(one, substeps=n), start) - exact
    errors = [float(jnp.max(jnp.std(off(n), axis=(0, 1)) / sigma)) for n in (1, steps)]
    assert errors[0] > 3.0 and errors[1] < 0.025
    assert substeps_unseen(vehicle, one, start, 1e3 * sigma) == 1
    assert substeps_unseen(oscillator(), one, start[:, :2], sigma) == 1
    stiff = bending(0.05)
    assert not bool(jnp.all(jnp.isfinite(simulate(stiff, one, start))))
    assert substeps_unseen(stiff, one, start, sigma) > steps


def test_a_spring_that_turns_within_a_sample_is_simulated_below_the_noise():
    """Claim: at 6 rad/s and 5 Hz one step a sample is off by more than the noise, and those taken by a tenth of it."""
    stiff = oscillator(coefficients={"D_x": 0.3, "K_x": 36.0, "B_x_drive": 20.0})
    given = driven(stiff, 0.2 * np.arange(200), 0, amplitude=1.0)
    runs = batch(stiff, synthetic(stiff, [given], seed=2, states=integrate, noise=False))
    sigma, start = jnp.array([output.sigma for output in stiff.layout.outputs]), initial_guess(stiff, runs)[0]
    off = lambda n: simulate(stiff, dataclasses.replace(runs, substeps=n), start) - runs.outputs
    errors = [float(jnp.max(jnp.sqrt(jnp.mean(off(n) ** 2, (0, 1))) / sigma)) for n in (1, runs.substeps)]
    assert errors[0] > 1.0 and errors[1] < 0.1


@pytest.mark.long
def test_an_effect_that_turns_within_a_sample_is_fitted_with_its_own_numbers():
    """Claim: yield force and distance come out within three standard errors of the truth, though the trial steps once a
    sample until it has the effect."""
    plain = oscillator()
    runs = batch(plain, bent())
    found = fit(plain, runs.take([0, 1], 2))
    view = look(found)
    fitter, base = ModelFitter(lambda message: None, plain), fitted_model(found, view, ())
    made = fitter.with_effects(base, [Hysteresis("x", jnp.asarray(0.3), jnp.asarray(0.3))], view.disturbance)
    assert runs.substeps == 1 < made.fit.runs.substeps
    ended = evaluate(made.fit)
    for name, true in {"hysteresis[x].F_h": 0.5, "hysteresis[x].x_y": 0.1}.items():
        assert abs(ended.values[name] - true) < 3.0 * ended.standard_errors[name] < 0.1 * true


def test_a_file_with_fast_damping_is_simulated_as_finely_as_it_asks():
    """Claim: damping of 25 1/s is simulated from its file as SciPy integrates it, and what diverges anyhow as it is."""
    fast = oscillator().with_effect(QuadraticDamping("x", jnp.asarray(-40.0)))
    given = driven(fast, 0.2 * np.arange(200), 0, amplitude=2.0)
    runs = batch(fast, synthetic(fast, [given], seed=2, states=integrate, noise=False))
    assert 1 < runs.substeps < FINEST
    shown = simulate(fast, runs, initial_guess(fast, runs)[0])
    assert float(jnp.max(jnp.abs(shown - runs.outputs))) < 1e-2 * float(jnp.max(jnp.abs(runs.outputs)))
    assert batch(oscillator(), [given]).substeps == 1
    assert batch(oscillator().with_effect(QuadraticDamping("x", jnp.asarray(1e3))), [given]).substeps == 1


@pytest.mark.long
def test_a_coefficient_asks_for_the_steps_that_its_effect_asks_for():
    """Claim: square damping of heave needs several steps a sample, whether it is an effect or a coefficient."""
    plain = vehicle_from(
        {"schema": 1, "name": "float", "kind": "submerged-body", "dof": ["heave"], "body": {"mass": 2.0},
         "coefficients": {"Z_T": 1.0}, "inputs": {"thrust": "T"}, "outputs": {"w": {"sigma": 0.01}}}, "float.toml",
    )  # fmt: skip
    effect = plain.with_effect(QuadraticDamping("heave", jnp.asarray(-40.0)))
    runs = synthetic(effect, [driven(effect, 0.2 * np.arange(60), 1, amplitude=20.0)], seed=2)
    steps = [batch(vehicle, runs).substeps for vehicle in (plain, effect, with_coefficients(effect))]
    assert steps[0] == 1 < steps[1] == steps[2]
