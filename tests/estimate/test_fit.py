"""A fit finds the optimum that SciPy finds, near the truth, within bounds and priors, and fails by value alone."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, recorded, stacked
from scipy.linalg import expm
from scipy.optimize import least_squares

from jaxsub.effects import KNOTS, SmoothForce
from jaxsub.estimate import Problem, fit, gauss_newton, initial_guess, search
from jaxsub.results import RESULTS
from jaxsub.simulation import simulate, synthetic
from jaxsub.vehicle.catalogue import dsrv, remus_100

NAMES = ("D_x", "K_x", "B_x_drive")
TRUTH = {"D_x": 0.6, "K_x": 4.0, "B_x_drive": 2.0}


def records(seed):
    return recorded(oscillator(), 2, 80, 0.1, seed, amplitude=1.0)


@pytest.fixture(scope="module")
def found():
    """The oscillator fitted to its own recordings, from a start that is a fifth off."""
    vehicle = oscillator()
    away = {name: vehicle.values()[name] * factor for name, factor in zip(NAMES, (0.8, 1.2, 0.8), strict=True)}
    return fit(vehicle.with_values(away), records(1))


def test_fit_of_a_mechanism_recovers_the_truth(found):
    assert bool(found.result == RESULTS.successful)
    assert found.gradient_norm < 0.1
    for name, value in TRUTH.items():
        error, standard_error = found.values[name] - value, found.standard_errors[name]
        assert 0.0 < standard_error < 0.05 * value
        assert abs(error) < 4.0 * standard_error
    for rms in found.rms.values():
        assert abs(rms - 1.0) < 4.0 / np.sqrt(2 * 160)


def test_fit_of_a_body_recovers_the_truth_from_a_start_a_fifth_off():
    vehicle = dsrv()
    inputs = driven(vehicle, 0.25 * np.arange(120), seed=2, amplitude=0.15, hold=8)
    runs = stacked(vehicle, synthetic(vehicle, [inputs], seed=2))
    truth = {row.name: float(vehicle.values()[row.name]) for row in vehicle.layout.free}
    factors = np.random.default_rng(2).choice([0.8, 1.2], len(truth))
    away = {name: jnp.asarray(value * f) for (name, value), f in zip(truth.items(), factors, strict=True)}
    found = fit(vehicle.with_values(away), runs)
    assert bool(found.result == RESULTS.successful)
    for name, value in truth.items():
        assert abs(found.values[name] - value) < 4.0 * found.standard_errors[name]


def exact_outputs(theta, start, force):
    """The oscillator's exact answer to a held force, one sample after the other."""
    D, K, B = theta
    block = np.zeros((3, 3))
    block[:2] = [[-D, -K, B], [1.0, 0.0, 0.0]]
    step = expm(0.1 * block)
    states = [np.asarray(start)]
    for f in force[:-1]:
        states.append((step @ [*states[-1], f])[:2])
    return np.stack(states)[:, ::-1]


def test_optimum_is_that_of_scipy_on_an_exact_model(found):
    # steps so small that what they leave out, 0.07 standard errors of K_x in one a sample, does not show
    runs, sigma = dataclasses.replace(found.runs, substeps=4), np.array([0.01, 0.02])
    found = fit(found.vehicle, runs)
    guess, spread = map(np.asarray, initial_guess(oscillator(), runs))

    def residuals(y):
        starts = y[3:].reshape(2, 2)
        modelled = [exact_outputs(y[:3], s, np.asarray(f)) for s, f in zip(starts, runs.signals[..., 0], strict=True)]
        errors = (np.asarray(runs.outputs) - np.stack(modelled)) / sigma
        return np.concatenate([errors.ravel(), ((starts - guess) / spread).ravel()])

    best = least_squares(residuals, np.concatenate([list(TRUTH.values()), guess.ravel()]), xtol=1e-12, ftol=1e-12)
    covariance = np.linalg.inv(best.jac.T @ best.jac)[:3, :3]
    np.testing.assert_allclose([found.values[name] for name in NAMES], best.x[:3], rtol=1e-5)
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-3)
    np.testing.assert_allclose(found.cost, best.cost, rtol=1e-5)


@pytest.mark.long
def test_file_whose_model_is_unstable_is_fitted_as_if_it_ran():
    """Claim: from REMUS as published, whose free run is lost in seconds, the fit ends where one from the truth ends."""
    file = remus_100()
    damped = {"Y_v": -200.0, "N_r": -18.0, "Z_w": -80.0, "M_q": -10.0, "N_v": -20.0, "M_w": 20.0}
    truth = file.with_values({name: jnp.asarray(value) for name, value in damped.items()})
    runs = dataclasses.replace(recorded(truth, 2, 150, 0.2, 1), substeps=2)
    assert bool(fit(file, runs, method=gauss_newton()).result == RESULTS.nan_start)
    reached, expected = fit(file, runs), fit(truth, runs)
    assert bool(reached.result == RESULTS.successful)
    np.testing.assert_allclose(reached.cost, expected.cost, rtol=1e-6)
    for name, value in damped.items():
        assert abs(reached.values[name] - value) < 4.0 * reached.standard_errors[name]


def test_start_that_does_not_run_is_a_result_and_no_exception(found):
    hopeless = oscillator().with_values({"D_x": jnp.asarray(-1e5)})
    assert bool(fit(hopeless, found.runs).result == RESULTS.nan_start)


def test_search_of_the_initial_states_alone_keeps_the_vehicle(found):
    vehicle = oscillator().with_values({"K_x": jnp.asarray(4.4)})
    kept = search(vehicle, found.runs, moving=False)
    assert {name: float(kept.vehicle.values()[name]) for name in NAMES} == pytest.approx(
        TRUTH | {"K_x": 4.4}, rel=1e-12
    )
    assert np.abs(kept.start - initial_guess(vehicle, found.runs)[0]).max() > 1e-4


def test_bound_is_kept_and_reached_where_the_data_ask_for_more():
    values = {
        "D_x": {"value": 1.0, "bounds": [0.7, 5.0]},
        "K_x": {"value": 3.0, "bounds": [0.0, 3.5]},
        "B_x_drive": 2.0,
    }
    found = fit(oscillator(coefficients=values), records(1))
    assert 0.7 <= found.values["D_x"] < 0.701
    assert 3.499 < found.values["K_x"] <= 3.5
    assert found.result == RESULTS.successful


def test_prior_weighs_against_the_data_as_their_precisions_do():
    fixed = {"D_x": {"value": 0.6, "fixed": True}, "B_x_drive": {"value": 2.0, "fixed": True}}
    runs = records(1)
    free = fit(oscillator(coefficients=fixed | {"K_x": 4.006}), runs)
    size = free.standard_errors["K_x"]
    told = fit(oscillator(coefficients=fixed | {"K_x": {"value": 4.006, "prior_std": size}}), runs)
    np.testing.assert_allclose(told.values["K_x"], 0.5 * (free.values["K_x"] + 4.006), atol=0.02 * size)
    np.testing.assert_allclose(told.standard_errors["K_x"], size / np.sqrt(2.0), rtol=0.02)


def test_spread_of_a_smooth_force_weighs_its_heights_about_zero_wherever_they_begin():
    """Claim: the cost with heights a of spread s is that without a spread and ½ Σ (a/s)², the search's start too."""
    begun = {f"a_{j}": jnp.asarray(0.1 * (-1.0) ** j) for j in range(KNOTS)}
    vehicles = [oscillator().with_effect(SmoothForce("x", "x_rate", -1.0, 1.0, s, **begun)) for s in (0.2, np.inf)]
    sigma, still = jnp.array([0.01, 0.02]), jnp.zeros((2, 2))
    told, free = (Problem.of(v, records(1), sigma, still, known_start=True) for v in vehicles)
    for y in (told.origin, 0.5 * told.origin):
        a = np.array([v for name, v in told.vehicle_at(y).values().items() if name.startswith("smooth-force")])
        assert len(a) == KNOTS
        np.testing.assert_allclose(float(told.cost(y) - free.cost(y)), 0.5 * np.sum((a / 0.2) ** 2), rtol=1e-6)


def test_noise_to_be_estimated_is_the_rms_of_what_is_left():
    unknown = oscillator(outputs={"x": {"sigma": "estimate"}, "x_rate": {"sigma": 0.02}})
    found = fit(unknown, records(1))
    left = np.sqrt(np.mean(np.asarray(found.model.error) ** 2, (0, 1)))
    np.testing.assert_allclose(found.sigma, [left[0], 0.02], rtol=3e-3)
    assert abs(found.sigma[0] / 0.01 - 1.0) < 4.0 / np.sqrt(2 * 160)


def test_rate_that_nothing_measures_begins_as_fast_as_its_coordinate_moves():
    """Claim: a coordinate of 400 rad/s begins at its true 60/s though the noise is said to be a third of its motion."""
    fast = {"D_x": 40.0, "K_x": 160_000.0, "B_x_drive": 1.0}
    vehicle = oscillator(coefficients=fast, outputs={"x": {"sigma": 0.05}})
    runs = stacked(vehicle, [driven(vehicle, 0.001 * np.arange(200), seed=1)])
    start = jnp.array([[60.0, 0.0]])
    runs = dataclasses.replace(runs, outputs=simulate(vehicle, runs, start), mask=jnp.ones_like(runs.mask))
    found = search(vehicle, runs, moving=False).start
    np.testing.assert_allclose(found, start, rtol=0.02, atol=0.002)


def test_first_measured_sample_starts_the_search_whatever_a_coordinate_is_called():
    names = {"D_roll": 0.6, "K_roll": 4.0}
    decay = oscillator(dof=["roll"], coefficients=names, inputs={}, outputs={"roll": {}, "roll_rate": {}})
    runs = stacked(decay, [driven(decay, 0.1 * np.arange(4), seed=1)])
    outputs = runs.outputs.at[0, 1].set(jnp.array([0.3, -0.2]))
    runs = dataclasses.replace(runs, outputs=outputs, mask=runs.mask.at[0, 1].set(True))
    np.testing.assert_array_equal(initial_guess(decay, runs)[0], [[-0.2, 0.3]])
