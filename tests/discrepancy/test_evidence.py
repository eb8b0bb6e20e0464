"""Evidence is the Gaussian integral that it claims to be, χ² under the null, and largest for what was concealed."""

import dataclasses
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import INTERVAL, recorded, wrong
from jax import Array
from scipy import stats

from jaxsub.discrepancy.accept.model import is_admissible
from jaxsub.discrepancy.explain.locate import effect_shares
from jaxsub.discrepancy.linearise.columns import candidate_columns, plausible, sensor_changes
from jaxsub.discrepancy.linearise.evidence import Evidence, evidence_of
from jaxsub.discrepancy.linearise.products import Products, conditional
from jaxsub.discrepancy.linearise.view import Parts, facts, look
from jaxsub.discrepancy.propose.name import select
from jaxsub.discrepancy.propose.selector import Selector
from jaxsub.effects import AbstractInstrument, FluidMemory, amplitude, candidates
from jaxsub.effects.hull import CrossflowDrag
from jaxsub.effects.sensor_mounting import SensorLeverArm
from jaxsub.effects.sensors import SensorScale
from jaxsub.estimate import batch, fit
from jaxsub.likelihood import Disturbance, total_products, whitened


@pytest.fixture(scope="module")
def fitted():
    return fit(wrong(), batch(wrong(), recorded(None, 1)[:2]))


@pytest.fixture(scope="module")
def clean(fitted):
    return look(fitted)


@pytest.fixture(scope="module")
def dense():
    """Random whitened columns: a residual, three free parameters and five candidates, and priors of the parameters."""
    rng = np.random.default_rng(0)
    W = rng.standard_normal((40, 9))
    W[:, 0] += 0.8 * W[:, 5]
    prior = np.diag([0.0, 0.3, 0.2, 0.1])
    gram = W.T @ W
    gram[:4, :4] += prior
    return W, prior, Products(Disturbance(*jnp.ones((3, 1))), gram, 0.7, 40, 4)


def log_evidence(W, prior, chosen):
    """By the covariance of the data: amplitudes of prior variance N, parameters of their own."""
    J, S = W[:, 1:4], W[:, [4 + c for c in chosen]]
    covariance = np.eye(40) + J @ np.diag(1.0 / np.diag(prior)[1:]) @ J.T + 40.0 * S @ S.T
    whole = stats.multivariate_normal(np.zeros(40), covariance).logpdf(W[:, 0])
    # what neither the candidates nor the data change
    constant = -20.0 * np.log(2.0 * np.pi) + 0.5 * np.sum(np.log(np.diag(prior)[1:]))
    return whole - constant - 0.7


@pytest.mark.parametrize("chosen", [[], [0, 3]])
def test_a_part_is_predicted_by_all_that_the_others_leave_open(dense, chosen):
    """Claim: it is the density of the part given the others, of the dense covariance of all."""
    W, prior, whole = dense
    rows = np.split(np.arange(40), 4)
    own = W[:, [0, 1, 2, 3, *(4 + c for c in chosen)]]
    split = Parts(np.stack([own[at].T @ own[at] for at in rows]), np.array([0.1, 0.2, 0.3, 0.1]))
    J, S = W[:, 1:4], W[:, [4 + c for c in chosen]]
    found = conditional(whole.with_priors(chosen), split)
    covariance = np.eye(40) + J @ np.diag(1.0 / np.diag(prior)[1:]) @ J.T + 40.0 * S @ S.T
    density = lambda at: stats.multivariate_normal(np.zeros(len(at)), covariance[np.ix_(at, at)]).logpdf(W[at, 0])
    for at, spread, predicted in zip(rows, split.log_determinants, found, strict=True):
        given = density(np.arange(40)) - density(np.setdiff1d(np.arange(40), at))
        np.testing.assert_allclose(predicted, given + 5.0 * np.log(2.0 * np.pi) - spread, rtol=1e-10)


@pytest.mark.parametrize("chosen", [[], [1], [0, 3], [1, 2, 4]])
def test_it_is_the_integral_over_all_amplitudes(dense, chosen):
    W, prior, products = dense
    np.testing.assert_allclose(products.log_evidence(chosen), log_evidence(W, prior, chosen), rtol=1e-10)


def test_gains_on_top_of_chosen_ones_are_differences_of_evidence(dense):
    W, prior, products = dense
    gains = products.gains([1], [[0], [2, 3], [4]])
    expected = [log_evidence(W, prior, [1, *own]) - log_evidence(W, prior, [1]) for own in ([0], [2, 3], [4])]
    np.testing.assert_allclose(gains.evidence, expected, rtol=1e-9)


def test_shares_of_the_runs_have_the_sum_of_the_whole():
    """Claim: products of 15 runs, filtered in two shares of which one has an empty run, are those of one pass.

    Whether the columns of the shares are kept or made anew; and a sum of columns is that of the dense ones.
    """
    view = look(fit(wrong(), batch(wrong(), 5 * recorded(None, 1))))
    columns, _ = candidate_columns(view, candidates(facts(view), (CrossflowDrag, SensorScale)))
    evidence = Evidence.of(view, columns, [view.disturbance])
    assert len(evidence.shares) == 2 and len(evidence.shares[0].shown) == 8
    whole = view.base + columns.dense()
    gram, log_determinant = total_products(view.disturbance, view.followed.system, whole)
    unit = np.concatenate([np.ones(len(view.prior)), evidence.length])
    expected = np.asarray(gram) / np.outer(unit, unit)
    expected[: len(view.prior), : len(view.prior)] += view.prior
    for found in (evidence, dataclasses.replace(evidence, shares=())):
        products = found.under(view.disturbance)
        np.testing.assert_allclose(products.gram, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
        assert products.log_determinant == pytest.approx(float(log_determinant), rel=1e-12)
    chosen = [len(columns) - 1, 0]
    weights = products.weights(chosen) / unit
    left = evidence.left(chosen, products)
    for found, dense in zip(jax.tree.leaves(left), jax.tree.leaves(whole), strict=True):
        np.testing.assert_allclose(found[..., 0], dense @ weights, rtol=1e-9, atol=1e-9)


def test_statistic_is_chi_square_where_nothing_is_left_out(clean):
    effects = [e for e in candidates(facts(clean)) if e.family in ("hull", "hydrostatics", "sensors")]
    columns, owners = candidate_columns(clean, effects)
    base = clean.base + columns.dense()
    white = np.array(whitened(clean.disturbance, clean.followed.system, base)[0]).reshape(-1, base.shown.shape[-1])
    measured = np.asarray(clean.followed.system.measured).ravel()
    rng, draws = np.random.default_rng(2), []
    for _ in range(60):
        white[:, 0] = rng.standard_normal(len(white)) * measured
        gram = white.T @ white
        gram[: len(clean.prior), : len(clean.prior)] += np.asarray(clean.prior)
        products = Products(clean.disturbance, gram, 0.0, int(measured.sum()), len(clean.prior))
        single = [own for own in owners if len(own) == 1]
        kept = products.kept(single)
        draws.append(products.gains([], single).statistic[kept > 1e-3])
    values = np.array(draws)
    assert values.shape[1] > 8
    assert abs(values.mean() - 1.0) < 0.2
    assert abs(np.mean(values > stats.chi2.ppf(0.95, 1)) - 0.05) < 0.03


@pytest.mark.parametrize(
    ("effect", "field", "tolerance"),
    [
        (CrossflowDrag("vertical", 5.0, 0.761, 0.3), "C_d", 0.25),
        pytest.param(SensorScale("q", 0.05), "scale", 0.15, marks=pytest.mark.long),
    ],
)
def test_the_concealed_effect_comes_first_with_its_amplitude(effect, field, tolerance):
    view = look(fit(wrong(), batch(wrong(), recorded(effect, 2)[:2])))
    tried = candidates(facts(view))
    columns, owners = candidate_columns(view, tried)
    selector = Selector(Evidence.of(view, columns), tried, owners, {})
    chosen, scans, p_values = select(selector, lambda message: None)
    assert [tried[i].name for i in chosen] == [effect.name]
    assert p_values[0] < 1e-6 < 0.01 < p_values[1]
    truth = float(getattr(effect, field))
    assert abs(float(getattr(scans[0].effects[chosen[0]], field)) / truth - 1.0) < tolerance


def test_wrong_scale_of_the_noise_raises_no_alarm():
    quiet = wrong()
    rows = tuple(dataclasses.replace(o, sigma=0.5 * (o.sigma or 1.0)) for o in quiet.layout.outputs)
    quiet = dataclasses.replace(quiet, layout=dataclasses.replace(quiet.layout, outputs=rows))
    view = look(fit(quiet, recorded(None, 1)[:2]))
    np.testing.assert_allclose(view.disturbance.noise, 2.0, rtol=0.15)
    tried = candidates(facts(view))
    columns, owners = candidate_columns(view, tried)
    chosen, _, p_values = select(Selector(Evidence.of(view, columns), tried, owners, {}), lambda message: None)
    assert chosen == [] and p_values[0] > 0.01
    assert jnp.isfinite(view.covariance).all()


def test_a_sensor_errs_by_less_than_it_shows_and_an_arm_is_no_longer_than_its_reach(clean):
    """Claim: a scale error of 90 % may be and one of 110 % not; an arm of two lengths whatever it adds, no longer."""
    assert plausible(clean, SensorScale("w", -0.9))
    assert not plausible(clean, SensorScale("w", -1.1))
    within = SensorLeverArm("w", "x", jnp.asarray(2.0 * clean.vehicle.layout.length))
    assert np.ptp(sensor_changes(clean.path, within)["w"]) > np.ptp(clean.measured("w"))
    assert plausible(clean, within)
    assert not plausible(clean, SensorLeverArm("w", "x", jnp.asarray(2.1 * clean.vehicle.layout.length)))


class Gain(AbstractInstrument):
    """One gain of two channels."""

    name: ClassVar[str] = "one-gain"
    family: ClassVar[str] = "own"
    gain: Array = amplitude("1")
    channels: ClassVar[tuple[str, ...]] = ("w", "q")
    expression: ClassVar[str] = "(1 + gain) w, (1 + gain) q"

    @classmethod
    def candidates(cls, facts):
        return [cls()]

    def show(self, times, outputs, motion):
        return {channel: (1.0 + self.gain) * outputs[channel] for channel in self.channels}


def test_an_instrument_is_one_column_in_all_its_channels_and_its_trace_is_theirs(clean):
    columns, owners = candidate_columns(clean, [Gain()])
    assert owners == [[0]]
    channels = clean.vehicle.layout.channels
    shown = columns.dense().shown[..., 0] * np.asarray(clean.sigma)
    for i, channel in enumerate(channels):
        expected = clean.path.true[channel] if channel in ("w", "q") else 0.0
        np.testing.assert_allclose(shown[..., i], np.where(clean.runs.mask[..., i], expected, 0.0), atol=1e-12)
    share = effect_shares(clean, [Gain(0.1)], clean.disturbance)
    assert set(share) == {"sensor:w", "sensor:q"}
    assert min(share.values()) > 0.01 and sum(share.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("samples", "coefficient", "stands"), [(4.0, -9.0, True), (0.3, -9.0, False), (4.0, 9.0, False), (1e9, -9.0, False)]
)
def test_a_memory_within_a_sample_or_beyond_the_runs_or_that_drives_is_unsound(fitted, samples, coefficient, stands):
    memory = FluidMemory("pitch", coefficient, samples * INTERVAL)
    found = dataclasses.replace(fitted, vehicle=fitted.vehicle.with_effect(memory))
    assert is_admissible(found, [memory]) is stands


def test_a_view_is_the_same_from_wherever_its_disturbance_is_sought():
    """Claim: a search from a disturbance a hundred times too large, as before a join, ends at the same evidence."""
    fitted = fit(wrong(), batch(wrong(), recorded(CrossflowDrag("vertical", 5.0, 0.761, 0.3), 2)[:2]))
    view = look(fitted)
    far = dataclasses.replace(view.disturbance, force=100.0 * view.disturbance.force)
    assert evidence_of(look(fitted, far)) == pytest.approx(evidence_of(view), abs=2.0)
