"""That a number differs from run to run is found with its spread, and is not seen where the runs do not differ."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator
from scipy import stats
from scipy.optimize import minimize_scalar

from jaxsub.discrepancy import diagnose
from jaxsub.discrepancy.accept.cross_validation import simulated
from jaxsub.discrepancy.accept.model import p_value, restricted_log_likelihood, without_variation
from jaxsub.discrepancy.linearise.products import Products, integrated
from jaxsub.discrepancy.linearise.view import facts, look
from jaxsub.discrepancy.search.examine import listed
from jaxsub.effects import CoulombFriction, RunVariation, SensorBias, SensorDrift
from jaxsub.estimate import batch, fit
from jaxsub.likelihood import Disturbance
from jaxsub.simulation import sampled_states, synthetic
from jaxsub.vehicle import read_vehicle, write_vehicle

# samples of six runs, of which 1 + 3 columns are known and 2 are candidates; the second known number may differ by run
RUNS, KNOWN, SIGMA = (8, 5, 11, 7, 6, 9), 4, 0.02
STEPS, MEAN, SPREAD = 60, 0.8, 0.1
VOCABULARY = (CoulombFriction, SensorBias, SensorDrift, RunVariation)


def columns(rng):
    """Whitened columns of six runs, of random length, and the number's column cut to each run."""
    W = rng.standard_normal((sum(RUNS), KNOWN + 2)) * [1.0, 2.0, 1.0, 0.5, 1.0, 1.0]
    run = np.repeat(np.arange(len(RUNS)), RUNS)
    return W, W[:, 2, None] * (run[:, None] == np.arange(len(RUNS)))


PRIOR = np.diag([0.0, 0.3, 0.2, 0.1])


def products(W, cut):
    gram = W.T @ W
    gram[:KNOWN, :KNOWN] += PRIOR
    among = np.einsum("nr,nr->r", cut, cut)[:, None, None]
    by_run = (cut.T @ W)[:, None]
    return Products(Disturbance(*jnp.ones((3, 1))), gram, 0.7, len(W), KNOWN, by_run, among)


def dense(W, cut, spread, chosen):
    """Log evidence by the covariance of the data, less what neither candidates nor data change."""
    J, S, n = W[:, 1:KNOWN], W[:, [KNOWN + c for c in chosen]], len(W)
    covariance = np.eye(n) + J @ np.diag(1.0 / np.diag(PRIOR)[1:]) @ J.T + n * S @ S.T + spread**2 * cut @ cut.T
    whole = stats.multivariate_normal(np.zeros(n), covariance).logpdf(W[:, 0])
    return whole + 0.5 * n * np.log(2.0 * np.pi) - 0.5 * np.sum(np.log(np.diag(PRIOR)[1:])) - 0.7


@pytest.mark.parametrize("chosen", [[], [1]])
def test_its_evidence_is_the_integral_at_the_most_probable_spread_which_counts_as_one_number(chosen):
    """Claim: of a number whose deviations are 0.8 the evidence is that of the dense covariance at its best spread."""
    rng = np.random.default_rng(3)
    W, cut = columns(rng)
    W[:, 0] += cut @ (0.8 * rng.standard_normal(len(RUNS)))
    made, varying = products(W, cut), 2
    found = minimize_scalar(lambda log: -dense(W, cut, np.exp(log), chosen), bounds=(-5.0, 3.0), method="bounded")
    expected = -found.fun - 0.5 * np.log(len(W))
    assert made.log_evidence([*chosen, varying]) == pytest.approx(expected, abs=1e-3)
    assert made.spreads([*chosen, varying]) == {0: pytest.approx(np.exp(found.x), rel=0.05)}
    gains = made.gains(chosen, [[0], [varying]])
    assert made.log_evidence(chosen) + gains.evidence[1] == pytest.approx(expected, abs=1e-3)
    # a candidate on top of it, at the same spread
    more = made.log_evidence([varying]) + made.gains([varying], [[0]]).evidence[0]
    spread = made.spreads([varying])[0]
    assert more == pytest.approx(dense(W, cut, spread, [0]) - 0.5 * np.log(len(W)), abs=1e-6)


def test_p_values_are_uniform_where_the_runs_do_not_differ():
    """Claim: over 3000 draws of the noise p < 0.05 in 5 %, p < 0.01 in 1 %; the spread is zero in half and more."""
    rng = np.random.default_rng(5)
    W, cut = columns(rng)
    p, none = [], 0
    for _ in range(3000):
        # free numbers of their prior's size
        W[:, 0] = W[:, 1:KNOWN] @ (rng.standard_normal(3) / np.sqrt(np.diag(PRIOR)[1:])) + rng.standard_normal(len(W))
        gains = products(W, cut).gains([], [[2]])
        p.append(stats.chi2.sf(gains.statistic[0], len(RUNS) - 1))
        none += float(gains.amplitudes[0][0]) == 0.0
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 0.012
    assert abs(np.mean(np.array(p) < 0.01) - 0.01) < 0.006
    assert stats.kstest(p, "uniform").pvalue > 0.01
    assert none > 1500


def rig(**offset):
    """An oscillator on a known spring, pushed by a constant force that may differ by run."""
    coefficients = {"D_x": 0.6, "K_x": {"value": 4.0, "fixed": True}, "B_x_drive": 2.0}
    force = {"value": MEAN} | offset
    return oscillator(coefficients=coefficients | {"F_x": force}, outputs={"x": {"sigma": SIGMA}})


def recordings(count, seed, spread):
    """Runs of a rig whose constant force differs by run, and those forces."""
    truth, rng = rig(varies="run", spread=SPREAD), np.random.default_rng(seed)
    deviations = spread * rng.standard_normal(count)
    start = jnp.asarray(np.column_stack([0.1 * rng.standard_normal((count, 2)), deviations]))
    inputs = [driven(truth, 0.2 * np.arange(STEPS), seed + i, amplitude=0.3, hold=5) for i in range(count)]
    return synthetic(truth, inputs, seed=seed, start=start, states=sampled_states), MEAN + deviations


def test_a_force_that_differs_by_run_is_named_with_its_spread_and_written(tmp_path):
    """Claim: beside friction, a bias and a drift it is named; the file has it, and its spread is that of the forces."""
    runs, forces = recordings(9, 1, SPREAD)
    found, improved = diagnose(rig(), runs[:8], runs[8:], vocabulary=VOCABULARY)
    (named,) = found.physics
    assert (found.verdict, named.label, named.equations) == ("named", "run-variation[F_x]", ["x"])
    spread = named.parameters["spread"]
    assert abs(spread.value - np.std(forces[:8], ddof=1)) < 0.1 * SPREAD
    assert spread.standard_error == pytest.approx(spread.value / np.sqrt(14.0), rel=0.2)
    assert "run-variation[F_x]" in found.summary and any("F_x differs by run" in note for note in found.notes)
    write_vehicle(improved, tmp_path / "improved.toml")
    again = read_vehicle(tmp_path / "improved.toml")
    assert {name: float(one) for name, one in again.spreads.items()} == {"F_x": spread.value}
    assert 'varies = "run"' in (tmp_path / "improved.toml").read_text(encoding="utf-8")
    assert found.fit["held_out"]["improved"]["x"] < 1.3


def test_runs_that_do_not_differ_have_no_such_effect():
    """Claim: of the same runs with one force nothing is missing."""
    runs, _ = recordings(9, 2, 0.0)
    found, improved = diagnose(rig(), runs[:8], runs[8:], vocabulary=VOCABULARY)
    assert found.verdict == "none" and not improved.spreads


@pytest.mark.long
def test_a_drift_of_the_sensor_is_no_difference_between_runs():
    """Claim: of runs that have a drift in common and forces that differ both are named, each as what it is."""
    truth = rig(varies="run", spread=SPREAD).with_effect(SensorDrift("x", jnp.asarray(0.02)))
    rng = np.random.default_rng(4)
    start = jnp.asarray(np.column_stack([0.1 * rng.standard_normal((9, 2)), SPREAD * rng.standard_normal(9)]))
    inputs = [driven(truth, 0.2 * np.arange(STEPS), i, amplitude=0.3, hold=5) for i in range(9)]
    runs = synthetic(truth, inputs, seed=4, start=start, states=sampled_states)
    found, _ = diagnose(rig(), runs[:8], runs[8:], vocabulary=VOCABULARY)
    assert {one.label for one in found.physics} == {"run-variation[F_x]", "sensor-drift[x]"}


@pytest.fixture(scope="module")
def followed():
    runs, _ = recordings(4, 6, SPREAD)
    return look(fit(rig(), batch(rig(), runs)))


def test_deviations_are_a_state_of_the_filter_or_columns_of_each_run_alike(followed):
    """Claim: the restricted likelihood with the deviation among a filter's states is that with it integrated out."""
    selector = listed(followed, VOCABULARY)
    number = next(i for i, e in enumerate(selector.candidates) if e.label == "run-variation[F_x]")
    chosen = selector.columns([number])
    made = selector.evidence.products[0]
    inside, fixed = made.within(chosen)
    assert fixed == [] and next(iter(made.spreads(chosen).values())) > 0.0
    expected = integrated(inside.with_priors([])) - inside.log_determinant
    own = selector.evidence.within(chosen, made).view
    found = restricted_log_likelihood(own)
    assert found == pytest.approx(expected, abs=1e-6)
    assert found - restricted_log_likelihood(followed) > 5.0
    assert selector.p_value(number, selector.scan([])) < 1e-6


@pytest.mark.long
def test_two_runs_are_too_few():
    """Claim: of two runs no number may differ, of three any that is free; a fixed one never."""
    runs, _ = recordings(3, 7, SPREAD)
    names = lambda count: [one[0] for one in facts(look(fit(rig(), batch(rig(), runs[:count])))).varying]
    assert names(2) == [] and sorted(names(3)) == ["B_x_drive", "D_x", "F_x"]


def test_a_fitted_spread_is_tested_against_none_and_blocks_are_predicted_by_the_others():
    """Claim: the p-value is small where forces differ; each block has the errors of a fit to all others.

    That fit has the run's own deviation, Gaussian about zero, by the other blocks of the run.
    """
    runs, _ = recordings(4, 6, SPREAD)
    vehicle = rig(varies="run")
    whole = fit(vehicle, batch(vehicle, runs))
    view = look(whole)
    effect = RunVariation("F_x", spread=whole.vehicle.spreads["F_x"])
    assert p_value(view, effect) < 1e-6
    assert restricted_log_likelihood(view) > restricted_log_likelihood(without_variation(view, effect)) + 10.0
    found, model = simulated(whole, 4), whole.model.share(0)[1]
    spread, at = np.asarray(whole.problem.start_std), 2
    assert whole.vehicle.layout.states[at] == "F_x.deviation"
    e, J, X = (np.asarray(part)[:, :, 0] / SIGMA for part in (model.error, model.theta, model.start))
    X, p = X * spread, J.shape[-1]
    moved = np.asarray(whole.start)[:, at] / spread[at]
    # the states proper follow, fitted to all of the run
    rows, left = [], []
    for r in range(4):
        S, both = X[r][:, :at], np.column_stack([J[r], X[r][:, at]])
        rest = both - S @ np.linalg.solve(S.T @ S + np.eye(at), S.T @ both)
        wide = np.zeros((len(rest), p + 4))
        wide[:, :p], wide[:, p + r] = rest[:, :p], rest[:, p]
        rows.append(wide)
        left.append(e[r])
    blocks = [(r, part) for r in range(4) for part in np.array_split(np.arange(STEPS), 4)]
    for number, block in enumerate(blocks):
        rest = [other for other in blocks if other is not block]
        A = np.concatenate([*(rows[r][part] for r, part in rest), np.eye(p + 4)[p:]])
        y = np.concatenate([*(left[r][part] for r, part in rest), -moved])
        step = np.linalg.lstsq(A, y)[0]
        r, part = block
        assert found[number] == pytest.approx(-0.5 * np.sum((left[r][part] - rows[r][part] @ step) ** 2), rel=2e-2)
