"""Models are compared by how well they predict blocks of the training runs from the other blocks."""

import dataclasses
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator
from scipy import stats

from jaxsub.discrepancy.accept.cross_validation import (
    Comparison,
    Gain,
    Predicted,
    compare,
    gain,
    one_step_ahead,
    simulated,
)
from jaxsub.discrepancy.accept.verdict import NOTHING, with_gain
from jaxsub.discrepancy.linearise.view import look
from jaxsub.estimate import batch, fit
from jaxsub.likelihood import BlockLinearised, whitened
from jaxsub.simulation import synthetic


@cache
def fitted():
    """An oscillator fitted to two of its own runs, the second shorter."""
    truth = oscillator()
    inputs = [driven(truth, 0.1 * np.arange(count), seed, amplitude=1.0) for seed, count in ((0, 240), (1, 180))]
    runs = batch(truth, synthetic(truth, inputs, seed=3))
    return fit(truth, runs)


@pytest.mark.parametrize("blocks", [4, 8, 48])
def test_p_values_are_uniform_where_neither_model_is_better(blocks):
    """Claim: of 4000 comparisons without a difference p < 0.05 in 5 %, p < 0.001 in 0.1 %, and p is uniform."""
    rng = np.random.default_rng(blocks)
    found = [gain(np.zeros(blocks), rng.standard_normal(blocks)) for _ in range(4000)]
    better = np.array([one.better for one in found])
    assert np.mean(better < 0.05) == pytest.approx(0.05, abs=0.012)
    assert np.mean(better < 0.001) < 0.003
    assert stats.kstest(better, "uniform").pvalue > 0.001
    np.testing.assert_allclose(better + [one.worse for one in found], 1.0)


def test_the_p_value_of_symmetric_differences_is_that_of_scipys_t_test():
    """Claim: where blocks differ without skewness it is SciPy's one-sided paired t-test."""
    rng = np.random.default_rng(5)
    before, half = rng.standard_normal((2, 20))
    difference = 0.3 + np.concatenate([half, -half])
    reference = stats.ttest_1samp(difference, 0.0, alternative="greater").pvalue
    found = gain(np.tile(before, 2), np.tile(before, 2) + difference)
    assert found.better == pytest.approx(reference, rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_tells_in_few_blocks_is_tested_at_its_level(sign):
    """Claim: of skewed differences of mean zero p < 0.05 in 5 ± 3 %, where Student's t has over 12 or below 2 %."""
    rng = np.random.default_rng(11)
    blocks = sign * (rng.chisquare(1, (4000, 24)) - 1.0)
    ours = np.mean([gain(np.zeros(24), one).better < 0.05 for one in blocks])
    students = np.mean(stats.ttest_1samp(blocks, 0.0, axis=1, alternative="greater").pvalue < 0.05)
    assert abs(ours - 0.05) < 0.03
    assert students < 0.02 if sign > 0.0 else students > 0.12


def test_a_model_that_diverges_gains_nothing_and_one_that_does_no_more_gains():
    """Claim: where the model with more diverges it is rejected, where only the one with less does it is accepted."""
    fine, lost = Predicted(np.zeros(24), np.zeros(8)), Predicted(np.full(24, -np.inf), np.full(8, -np.inf))
    assert not compare(fine, lost).accepted
    assert not compare(lost, lost).accepted
    assert compare(lost, fine).accepted
    assert not compare(lost, fine, admissible=False).accepted
    said = with_gain(NOTHING, "cubic-damping[x]", compare(lost, fine))
    assert "diverge without it" in said.notes[0] and [one.outcome for one in said.decisions] == ["accepted"] * 2


@pytest.mark.parametrize(
    ("one_step", "simulation", "accepted"),
    [((1e-3, 0.9), (0.5, 0.5), True), ((0.5, 0.5), (1e-3, 0.9), True), ((0.5, 0.5), (0.5, 0.5), False),
     ((1e-3, 0.9), (0.99, 1e-3), False), ((0.99, 1e-3), (1e-3, 0.9), False)],
)  # fmt: skip
def test_accepted_is_what_is_better_at_one_horizon_and_worse_at_none(one_step, simulation, accepted):
    """Claim: a gain at one horizon is enough, and a loss at the other takes it back."""
    found = Comparison(Gain(1.0, *one_step), Gain(1.0, *simulation), 1.0, True)
    assert found.accepted is accepted


@pytest.mark.parametrize(("total", "accepted"), [(-2.0, True), (-4.0, False)])
def test_a_clear_loss_one_step_ahead_is_not_made_good_by_simulation(total, accepted):
    """Claim: what simulates better is rejected where its density one step ahead is clearly lower; a record says so."""
    found = Comparison(Gain(total, 0.8, 0.2), Gain(100.0, 1e-3, 0.999), 0.5, True)
    assert found.accepted is accepted
    decisions = with_gain(NOTHING, "cubic-damping[x]", found).decisions
    assert decisions[-1].test.startswith("gain in") is not accepted


def test_a_block_one_step_ahead_has_its_gaussian_conditional_density():
    """Claim: it is the density of its whitened innovations given those of the other blocks, by dense covariances."""
    view = look(fitted())
    found = one_step_ahead(view)
    white, factor = whitened(view.disturbance, view.followed.system, view.base)
    white, factor = np.asarray(white), np.asarray(factor)
    free, logs = white.shape[-1] - 1, np.log(np.diagonal(factor, axis1=-2, axis2=-1))
    # 240 and 180 samples in blocks of ten
    places = [(run, slice(k, k + 10)) for run, count in ((0, 240), (1, 180)) for k in range(0, count, 10)]
    pieces, spread = [white[place] for place in places], [logs[place].sum() for place in places]
    assert len(found) == len(places)
    r = [piece[..., 0].ravel() for piece in pieces]
    J = [piece[..., 1:].reshape(-1, free) for piece in pieces]
    prior = np.asarray(view.prior)
    expected = []
    for b in range(0, len(pieces), 5):
        rest = [i for i in range(len(pieces)) if i != b]
        A = sum(J[i].T @ J[i] for i in rest) + prior[1:, 1:]
        mean = np.linalg.solve(A, sum(J[i].T @ r[i] for i in rest) + prior[1:, 0])
        covariance = np.eye(len(r[b])) + J[b] @ np.linalg.solve(A, J[b].T)
        density = stats.multivariate_normal(J[b] @ mean, covariance).logpdf(r[b])
        expected.append(density + 0.5 * len(r[b]) * np.log(2.0 * np.pi) - spread[b])
    np.testing.assert_allclose(found[::5], expected, rtol=1e-6, atol=1e-6)


def test_a_block_of_a_simulation_has_the_errors_of_a_fit_to_the_others():
    """Claim: it equals the squared errors after least squares on the other blocks, the initial states following."""
    whole = fitted()
    found = simulated(whole, 4)
    model, weight = whole.model.share(0)[1], np.asarray(whole.runs.mask) / np.asarray(whole.sigma)
    spread = np.asarray(whole.problem.start_std)
    error, theta, start = (np.asarray(part) for part in (model.error, model.theta, model.start))
    theta, start = theta * weight[..., None], start * weight[..., None] * spread
    error, samples = error * weight, 1 + np.asarray(whole.runs.live).sum(1)
    reduced = []
    for run in range(2):
        X, J = start[run].reshape(-1, start.shape[-1]), theta[run].reshape(-1, theta.shape[-1])
        reduced.append(theta[run] - start[run] @ np.linalg.solve(X.T @ X + np.eye(X.shape[1]), X.T @ J))
    blocks = [(run, part) for run in range(2) for part in np.array_split(np.arange(samples[run]), 4)]
    flat = lambda values, chosen: np.concatenate(
        [values[r][part].reshape(-1, *values[r].shape[2:]) for r, part in chosen]
    )
    for number, block in enumerate(blocks):
        rest = [other for other in blocks if other is not block]
        step = np.linalg.lstsq(flat(reduced, rest), flat(error, rest))[0]
        left = np.sum((flat(error, [block]) - flat(reduced, [block]) @ step) ** 2)
        assert found[number] == pytest.approx(-0.5 * left, rel=1e-3)


def test_a_vehicle_that_runs_away_is_predicted_nowhere():
    """Claim: a model that diverges along the training runs has no density in any block, and no NaN."""
    whole = fitted()
    away = whole.vehicle.with_values({"D_x": jnp.asarray(-1e3)})
    model = BlockLinearised.of(away, whole.runs, whole.start, whole.sigma, whole.problem.start_std)
    assert not bool(jnp.all(jnp.isfinite(model.error)))
    assert np.all(np.isneginf(simulated(dataclasses.replace(whole, vehicle=away, model=model))))


def test_a_vehicle_that_nearly_runs_away_raises_nothing():
    """Claim: where sums over blocks of sensitivities that are floats are none, no block has a density; no error."""
    whole = fitted()
    theta = np.asarray(whole.model.share(0)[1].theta / whole.sigma[:, None])
    # the second run's squares are the largest float's, and those of both runs are beyond it
    far = whole.model.share(0)[1].theta * np.sqrt(1.7e308 / np.sum(theta**2, axis=(1, 2)).max())
    model = dataclasses.replace(whole.model, kept=(dataclasses.replace(whole.model.share(0)[1], theta=far),))
    found = simulated(dataclasses.replace(whole, model=model), 1)
    assert np.all(np.isneginf(found))


def test_blocks_that_count_are_those_in_which_something_was_measured():
    """Claim: of two runs, one shorter and both padded, the blocks counted are those whose products are not empty."""
    fit = fitted()
    view = look(dataclasses.replace(fit, runs=fit.runs.padded()))
    counts = view.measured_by_part(24)
    products, logarithms = view.products(view.own, view.disturbance, 24)
    assert counts.sum() == int(np.asarray(view.followed.system.measured).sum())
    np.testing.assert_array_equal(counts > 0, (logarithms != 0.0) | np.any(products != 0.0, axis=(1, 2)))
    assert 0 < np.sum(counts == 0) < 24
