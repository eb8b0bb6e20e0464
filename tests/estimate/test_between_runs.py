"""Numbers that differ by run: mean, standard deviation between runs and each run's value are a linear mixed model's."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator
from scipy.optimize import minimize_scalar
from scipy.signal import cont2discrete

from jaxsub.errors import InputError
from jaxsub.estimate import Problem, batch, fit, initial_guess, search
from jaxsub.simulation import sampled_states, synthetic

# the natural frequency of the rig is 2 rad/s; its spring and damper are known, so that all else enters linearly
INTERVAL, SAMPLES, RUNS, SIGMA = 0.2, 30, 6, 0.02
MEAN, SPREAD = 0.8, 0.1


def rig(**offset):
    coefficients = {name: {"value": value, "fixed": True} for name, value in (("D_x", 0.6), ("K_x", 4.0))}
    force = {"value": MEAN} | offset
    outputs = {"x": {"sigma": SIGMA}}
    return oscillator(coefficients=coefficients | {"B_x_drive": 2.0, "F_x": force}, outputs=outputs)


def recordings(count, seed, spread=SPREAD):
    """Runs of a rig whose constant force differs by run, and those forces."""
    truth, rng = rig(varies="run", spread=SPREAD), np.random.default_rng(seed)
    deviations = spread * rng.standard_normal(count)
    start = jnp.asarray(np.column_stack([0.1 * rng.standard_normal((count, 2)), deviations]))
    inputs = [driven(truth, INTERVAL * np.arange(SAMPLES), seed + i, amplitude=0.3, hold=5) for i in range(count)]
    return synthetic(truth, inputs, seed=seed, start=start, states=sampled_states), MEAN + deviations


def answer(drive, force, start=(0.0, 0.0)):
    """x of the rig by SciPy, to a held drive and a constant force from the state (x_rate, x)."""
    A = np.array([[-0.6, -4.0], [1.0, 0.0]])
    step, gain, *_ = cont2discrete((A, np.array([[1.0], [0.0]]), np.eye(2), np.zeros((2, 1))), INTERVAL)
    states = [np.array(start, float)]
    for held in drive[:-1]:
        states.append(step @ states[-1] + gain[:, 0] * (held + force))
    return np.array(states)[:, 1]


class Dense:
    """The rig's runs as a linear mixed model, its covariance of all samples of a run written out."""

    def __init__(self, vehicle, made):
        guess, width = (np.asarray(part)[..., :2] for part in initial_guess(vehicle, batch(vehicle, made)))
        drives, zero = [run.column("f") for run in made], np.zeros(SAMPLES)
        constant = answer(zero, 1.0)
        own = np.column_stack([answer(zero, 0.0, axis) for axis in np.eye(2)]) * width
        self.X = [np.column_stack([answer(drive, 0.0), constant]) for drive in drives]
        # the initial state that the fit takes for its prior's mean is known
        known = [answer(zero, 0.0, state) for state in guess]
        self.y = [run.column("x") - moved for run, moved in zip(made, known, strict=True)]
        self.own, self.Z = own @ own.T + SIGMA**2 * np.eye(SAMPLES), constant

    def at(self, spread):
        """Minus the log restricted likelihood; estimates (drive, force), their covariance, each run's force, errors."""
        covariance = self.own + spread**2 * np.outer(self.Z, self.Z)
        weight = np.linalg.inv(covariance)
        information = sum(X.T @ weight @ X for X in self.X)
        beta = np.linalg.solve(information, sum(X.T @ weight @ y for X, y in zip(self.X, self.y, strict=True)))
        left = [y - X @ beta for X, y in zip(self.X, self.y, strict=True)]
        logs = len(self.X) * np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(information)[1]
        cost = 0.5 * (logs + sum(e @ weight @ e for e in left))
        gain = spread**2 * self.Z @ weight
        values = np.array([beta[1] + gain @ e for e in left])
        by = np.array([[0.0, 1.0] - gain @ X for X in self.X])
        own = spread**2 - spread**2 * gain @ self.Z
        inverse = np.linalg.inv(information)
        return cost, beta, inverse, values, np.sqrt(own + np.einsum("rp,pq,rq->r", by, inverse, by))


def test_is_the_restricted_likelihood_of_a_linear_mixed_model():
    """Claim: estimates, standard errors and each run's value are those of the dense Gaussian likelihood by NumPy."""
    vehicle = rig(varies="run")
    made, _ = recordings(RUNS, 3)
    found, dense = fit(vehicle, made), Dense(vehicle, made)
    cost = lambda log: dense.at(np.exp(log))[0]
    best = minimize_scalar(cost, bounds=(-8.0, 1.0), method="bounded", options={"xatol": 1e-6}).x
    (one,) = found.variations
    assert found.converged and one.estimated
    assert one.spread == pytest.approx(np.exp(best), rel=3e-3)
    _, beta, covariance, values, errors = dense.at(one.spread)
    # the fit steps the rig by a scheme of order four, with an error far below the noise
    deviations = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(list(found.values.values()) / deviations, beta / deviations, atol=0.03)
    np.testing.assert_allclose(list(found.standard_errors.values()), deviations, rtol=1e-3)
    np.testing.assert_allclose(one.values / errors, values / errors, atol=0.03)
    np.testing.assert_allclose(one.errors, errors, rtol=1e-3)
    h = 0.02
    curvature = (cost(best + h) - 2.0 * cost(best) + cost(best - h)) / h**2
    assert one.spread_error == pytest.approx(one.spread / np.sqrt(curvature), rel=0.02)


def test_the_stated_errors_cover_the_truth():
    """Claim: over 30 sets of 6 runs mean and runs' values scatter as their errors say; the variance is right."""
    vehicle = rig(varies="run")
    means, own, variances = [], [], []
    for seed in range(30):
        made, forces = recordings(RUNS, 1000 + 10 * seed)
        found = fit(vehicle, made)
        (one,) = found.variations
        means.append((found.values["F_x"] - MEAN) / found.standard_errors["F_x"])
        own += list((one.values - forces) / one.errors)
        variances.append(one.spread**2 / SPREAD**2)
    # a t distribution of 5 degrees of freedom has variance 5/3; χ² of 150 bounds the mean variance at four sigmas
    assert 0.8 < np.mean(np.square(means)) < 3.2
    assert np.std(own) == pytest.approx(1.0, abs=4.0 / np.sqrt(2 * len(own)))
    assert np.mean(variances) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / (30 * (RUNS - 1))))


def test_without_a_difference_it_is_the_plain_fit():
    """Claim: with hardly any standard deviation between runs values and errors are those of one number for all runs."""
    made, _ = recordings(RUNS, 5)
    narrow, plain = fit(rig(varies="run", spread=1e-9), made), fit(rig(), made)
    for name, value in plain.values.items():
        assert narrow.values[name] == pytest.approx(value, rel=1e-6)
        assert narrow.standard_errors[name] == pytest.approx(plain.standard_errors[name], rel=1e-5)
    (one,) = narrow.variations
    assert not one.estimated and one.spread_error is None


def test_runs_that_do_not_differ_have_the_mean():
    """Claim: of runs with one number the spread is small, and in about half of all cases zero, with no error of it."""
    zero = []
    for seed in range(6):
        found = fit(rig(varies="run"), recordings(RUNS, 50 + 10 * seed, spread=0.0)[0])
        (one,) = found.variations
        assert one.spread < 2.0 * one.errors.max()
        if one.spread == 0.0:
            zero.append(seed)
            np.testing.assert_allclose(one.values, found.values["F_x"], rtol=1e-12)
            assert one.spread_error is None and "do not differ beyond their noise" in one.sentence()
    assert 0 < len(zero) < 6


def test_gradient_by_means_and_deviations():
    """Claim: the cost's gradient is its numerical one, in the mean and in every run's deviation."""
    vehicle = rig(varies="run", spread=SPREAD)
    runs = batch(vehicle, recordings(RUNS, 7)[0])
    problem = Problem.of(vehicle, runs, jnp.array([SIGMA]))
    rng = np.random.default_rng(0)
    y = np.asarray(problem.coordinates()) + 0.1 * rng.standard_normal(2 + 3 * RUNS)
    gradient = np.asarray(problem.expand(jnp.asarray(y)).gradient)
    for i, step in enumerate(1e-5 * np.eye(len(y))):
        slope = (float(problem.cost(jnp.asarray(y + step))) - float(problem.cost(jnp.asarray(y - step)))) / 2e-5
        assert gradient[i] == pytest.approx(slope, rel=1e-5, abs=1e-4)


def test_one_run_cannot_show_a_spread_and_has_its_own_value_where_that_is_known():
    """Claim: one run is refused where the spread is open; where it is given its own value is found as a state is."""
    made, forces = recordings(1, 11)
    with pytest.raises(InputError, match="F_x differs by run, and there is one run; give more runs, or spread"):
        fit(rig(varies="run"), made)
    vehicle = rig(varies="run", spread=SPREAD)
    end = search(vehicle, batch(vehicle, made), moving=False)
    assert MEAN + float(end.start[0, 2]) == pytest.approx(forces[0], abs=0.06)
    unknown = rig(varies="run")
    assert float(search(unknown, batch(unknown, made), moving=False).start[0, 2]) == 0.0
