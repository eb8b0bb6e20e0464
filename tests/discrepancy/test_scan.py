"""The score of a candidate is χ² when nothing is left out, and predicts the amplitude when something is."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded, wrong
from scipy import stats

from jaxsub.discrepancy import batch
from jaxsub.discrepancy.columns import Trajectory, candidate_columns, facts
from jaxsub.discrepancy.scan import block_sums, project, scan
from jaxsub.effects import candidates
from jaxsub.effects.hull import CrossflowDrag
from jaxsub.effects.sensors import SensorScale
from jaxsub.estimate import fit


@pytest.fixture(scope="module")
def clean():
    return fit(wrong(), batch(wrong(), recorded(None, 1)[:2]))


def test_statistic_is_chi_square_under_the_null(clean):
    effects = candidates(facts(clean.vehicle, clean))
    columns, _ = candidate_columns(clean, Trajectory.of(clean), effects)
    rng = np.random.default_rng(0)
    draws = []
    for _ in range(40):
        noise = jnp.asarray(rng.normal(size=clean.model.error.shape)) * clean.sigma
        drawn = eqx.tree_at(lambda f: f.model.error, clean, noise)
        S, before, residual = project(drawn, columns)
        after = jnp.sum(S**2, (0, 1, 2))
        score = jnp.einsum("rkcq,rkc->q", S, residual) ** 2 / jnp.maximum(after, 1e-300)
        draws.append(np.asarray(score)[np.asarray(after > 1e-4 * before)])
    values = np.array(draws)
    assert values.shape[1] > 8
    assert abs(values.mean() - 1.0) < 0.2
    assert abs(np.mean(values > stats.chi2.ppf(0.95, 1)) - 0.05) < 0.03


def test_projection_matches_a_dense_regression(clean):
    effects = [e for e in candidates(facts(clean.vehicle, clean)) if e.name == "quadratic-damping"]
    columns, _ = candidate_columns(clean, Trajectory.of(clean), effects)
    S, _, _ = project(clean, columns)
    weight = np.asarray(clean.runs.mask / clean.sigma)[..., None]
    runs = weight.shape[0]
    start = np.asarray(clean.model.start) * weight
    dense = np.zeros((*start.shape[:3], runs * start.shape[3]))
    for r in range(runs):
        dense[r, ..., r * start.shape[3] : (r + 1) * start.shape[3]] = start[r]
    J = np.concatenate([np.asarray(clean.model.theta) * weight, dense], -1).reshape(
        -1, clean.model.theta.shape[-1] + dense.shape[-1]
    )
    # the initial states' priors, as extra rows
    prior = np.concatenate([np.zeros((dense.shape[-1], J.shape[1] - dense.shape[-1])), np.eye(dense.shape[-1])], 1)
    prior = prior / np.tile(np.asarray(clean.problem.spread), runs)[:, None]
    whole = np.concatenate([J, prior])
    columns = (np.asarray(columns) * weight).reshape(len(J), -1)
    target = np.concatenate([columns, np.zeros((len(prior), columns.shape[1]))])
    scale = np.linalg.norm(whole, axis=0)
    left = columns - (J / scale) @ np.linalg.lstsq(whole / scale, target, rcond=None)[0]
    np.testing.assert_allclose(np.asarray(S).reshape(left.shape), left, atol=1e-6 * np.abs(columns).max())


@pytest.mark.parametrize(
    ("effect", "field", "tolerance"),
    [(CrossflowDrag("vertical", 5.0, 0.761, 0.3), "C_d", 0.25), (SensorScale("q", 0.05), "scale", 0.15)],
)
def test_the_concealed_effect_comes_first_with_its_amplitude(effect, field, tolerance):
    found = fit(wrong(), batch(wrong(), recorded(effect, 2)[:2]))
    best = scan(found, candidates(facts(found.vehicle, found)), Trajectory.of(found))[0]
    assert best.effect.name == effect.name
    assert best.p_value < 1e-6
    truth = float(getattr(effect, field))
    assert abs(float(getattr(best.effect, field)) / truth - 1.0) < tolerance


def test_a_duplicated_vocabulary_scores_the_same(clean):
    effects = candidates(facts(clean.vehicle, clean))
    path = Trajectory.of(clean)
    once = [score.statistic for score in scan(clean, effects, path)]
    twice = [score.statistic for score in scan(clean, effects * 2, path)]
    np.testing.assert_allclose(twice, np.repeat(once, 2), atol=1e-8)


def test_block_sums_add_up_to_the_whole():
    rng = np.random.default_rng(1)
    S, r = jnp.asarray(rng.normal(size=(2, 37, 3, 4))), jnp.asarray(rng.normal(size=(2, 37, 3)))
    pairs = jnp.asarray([0, 1, 2, 3])
    towards, among = block_sums(S, r, pairs, pairs)
    np.testing.assert_allclose(towards.sum(0), jnp.einsum("rkcq,rkc->q", S, r), rtol=1e-12)
    np.testing.assert_allclose(among.sum(0), jnp.sum(S**2, (0, 1, 2)), rtol=1e-12)


def test_wrong_scale_of_the_noise_inflates_no_p_value(clean):
    halved = dataclasses.replace(clean, sigma=clean.sigma / 2.0)
    scores = scan(halved, candidates(facts(halved.vehicle, halved)), Trajectory.of(halved))
    assert min(score.p_value for score in scores) > 1e-3
