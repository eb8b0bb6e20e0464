"""How a model is led along its recordings, and which searches for its disturbance go on."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal
import scipy.stats
from diagnosis_cases import recorded, wrong
from rigs import driven, oscillator

from jaxsub.discrepancy.explain.consistency import expected_errors
from jaxsub.discrepancy.linearise import innovation_search, view
from jaxsub.discrepancy.linearise.columns import columns_of
from jaxsub.discrepancy.linearise.evidence import Evidence, evidence_of
from jaxsub.discrepancy.linearise.view import look
from jaxsub.discrepancy.records.diagnosis import ChannelQuality
from jaxsub.discrepancy.search.examine import listed
from jaxsub.effects import ActuatorLag, CubicDamping, CubicStiffness, QuadraticDamping, SensorDelay
from jaxsub.effects.hull import HullAsymmetry
from jaxsub.estimate import batch, fit
from jaxsub.likelihood import Disturbance, whitened
from jaxsub.likelihood.whiteness import portmanteau
from jaxsub.parameters import number
from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic


@pytest.fixture(scope="module")
def fitted():
    """A fit to recordings that conceal a force."""
    return fit(wrong(), batch(wrong(), recorded(HullAsymmetry("pitch", 3.0), 2)[:2]))


def led_to(times):
    """A search that ends at forces so many `times` larger than it began with."""
    return lambda system, columns, prior, start, **steps: dataclasses.replace(start, force=times * start.force)


def test_a_turn_leads_to_nothing_less_probable(fitted, monkeypatch):
    """Claim: a search for the disturbance that ends far off changes nothing; where half its way is right, half."""
    found = look(fitted)
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1.0))
    still = evidence_of(look(fitted, found.disturbance))
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1e8))
    assert evidence_of(look(fitted, found.disturbance)) > still - 0.5
    # a hundred times too large at first, and a step of ten thousand down: all of it is too far, half is right
    large = dataclasses.replace(found.disturbance, force=100.0 * found.disturbance.force)
    monkeypatch.setattr(view, "guessed", lambda fit: large)
    monkeypatch.setattr(innovation_search, "estimate_disturbance", led_to(1e-4))
    half = look(fitted)
    assert float(half.disturbance.force[0] / found.disturbance.force[0]) == pytest.approx(1.0, rel=1e-6)


def test_runs_of_unequal_length_have_a_disturbance(fitted):
    """Claim: samples that are padded change nothing: the disturbance, numbers and likelihood are those without them."""
    padded = fitted.runs.padded()
    assert padded.times.shape[1] > fitted.runs.times.shape[1]
    found, same = (look(one) for one in (fitted, fit(wrong(), padded)))
    assert evidence_of(same) == pytest.approx(evidence_of(found), rel=1e-6)
    assert np.asarray(same.disturbance.force) == pytest.approx(np.asarray(found.disturbance.force), rel=1e-3)
    # it moved from where it began
    begun = view.guessed(fitted)
    assert np.max(np.abs(np.log(found.disturbance.force / np.asarray(begun.force)))) > 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_random_force_far_above_the_noise_is_found(seed):
    """Claim: by innovations of an oscillator pushed about at random, by SciPy: time constant, size, and they are white.

    In simulation they are several σ off, and where the search for the force begins the first steps lead nowhere.
    """
    rng, times, size, slow = np.random.default_rng(seed), 0.2 * np.arange(600), 0.08, 3.0
    fade = math.exp(-0.2 / slow)
    system = scipy.signal.StateSpace([[0.0, 1.0], [-4.0, -0.6]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)))
    runs = []
    for i in range(2):
        drive = prbs(len(times), 15, 0.1, 10 * seed + i)
        force = scipy.signal.lfilter([math.sqrt(1.0 - fade**2)], [1.0, -fade], size * rng.standard_normal(len(times)))
        shown = scipy.signal.lsim(system, 2.0 * drive, times, interp=False)[1]
        shown = shown + scipy.signal.lsim(system, force, times)[1] + rng.standard_normal(shown.shape) * [0.01, 0.02]
        runs.append(Recording(f"run {i}", times, {"f": drive, "x": shown[:, 0], "x_rate": shown[:, 1]}, "test"))
    found = fit(oscillator(), batch(oscillator(), runs).padded())
    assert max(found.rms.values()) > 2.0
    seen = look(found)
    assert 0.5 < float(seen.disturbance.time[0]) / slow < 2.0
    assert 0.7 < float(seen.disturbance.force[0]) / size < 1.4
    evidence = Evidence.of(seen, columns_of(seen, []), [seen.disturbance])
    white, _ = whitened(seen.disturbance, seen.followed.system, evidence.left([], evidence.products[0]))
    assert portmanteau(np.asarray(white)[..., 0], np.asarray(seen.followed.system.measured)) > 1e-3


def test_what_is_random_is_as_large_as_many_simulations_are_off():
    """Claim: of an oscillator pushed about at random; forces slower than a block of a run count as none."""
    times, rng = 0.2 * np.arange(600), np.random.default_rng(5)
    runs = synthetic(oscillator(), [driven(oscillator(), times, seed=i) for i in range(2)], seed=1)
    seen = look(fit(oscillator(), batch(oscillator(), runs).padded()))
    size, slow = 0.1, 2.0
    pushed = lambda time: dataclasses.replace(
        seen, disturbance=Disturbance(np.array([size]), np.array([time]), np.ones(2))
    )
    fade = math.exp(-0.2 / slow)
    white = size * rng.standard_normal((200, len(times)))
    white[:, 1:] *= math.sqrt(1.0 - fade**2)
    force = scipy.signal.lfilter([1.0], [1.0, -fade], white)
    values = {name: float(value) for name, value in seen.vehicle.values().items()}
    system = scipy.signal.StateSpace(
        [[0.0, 1.0], [-values["K_x"], -values["D_x"]]], [[0.0], [1.0]], np.eye(2), np.zeros((2, 1))
    )
    still = np.zeros_like(times)
    begun = np.stack([scipy.signal.lsim(system, still, times, x0)[1] for x0 in np.eye(2)], axis=-1) / [[0.01], [0.02]]
    fitted = np.linalg.pinv(begun.reshape(-1, 2))
    off = np.stack([scipy.signal.lsim(system, one, times)[1] for one in force])
    taken = np.stack([(begun @ (fitted @ (one / [0.01, 0.02]).ravel())) * [0.01, 0.02] for one in off])
    off = off - taken
    stated = np.array([0.01, 0.02])
    rms = np.sqrt(1.0 + np.mean((off / stated) ** 2, axis=(0, 1)))
    channels = zip(seen.vehicle.layout.channels, stated, strict=True)
    quality = [ChannelQuality(channel, "", 600, 0.0, sigma, False, sigma) for channel, sigma in channels]
    np.testing.assert_allclose([*expected_errors(pushed(slow), stated, quality).values()], rms, rtol=0.1)
    assert [*expected_errors(pushed(30.0), stated, quality).values()] == [1.0, 1.0]
    # residuals with three times the stated noise, and white
    noisier = [dataclasses.replace(one, record_sigma=3.0 * one.sigma) for one in quality]
    assert [*expected_errors(pushed(30.0), stated, noisier).values()] == pytest.approx([3.0, 3.0])
    # of half the noise random forces leave twice as much
    quiet = [dataclasses.replace(one, record_sigma=0.5 * one.sigma) for one in quality]
    halved = np.sqrt(1.0 + 4.0 * (rms**2 - 1.0))
    np.testing.assert_allclose([*expected_errors(pushed(slow), 0.5 * stated, quiet).values()], halved, rtol=0.1)


def test_scores_of_clean_runs_are_uniform_where_nothing_measures_a_rate():
    """Claim: smallest p-values of six clean recordings are uniform (Kolmogorov and Smirnov), none below 0.01.

    The rate at the start may be anything a priori, and its drag is far from linear: a path that the first samples'
    noise leads astray has scores that no clean recording has.
    """
    coefficients, outputs = {"D_x": 0.1, "K_x": 1.0, "B_x_drive": 1.0}, {"x": {"sigma": 0.01}}
    rig = oscillator(coefficients=coefficients, outputs=outputs).with_effect(QuadraticDamping("x", number(-20.0)))
    p_values = []
    for seed in range(6):
        inputs = [driven(rig, 0.2 * np.arange(300), seed=10 * seed + run) for run in range(2)]
        seen = look(fit(rig, batch(rig, synthetic(rig, inputs, seed=seed)).padded()), near=rig)
        selector = listed(seen, (CubicDamping, CubicStiffness, SensorDelay, ActuatorLag))
        p_values.append(selector.smallest_p_value(selector.scan([])))
    assert min(p_values) > 0.01
    assert scipy.stats.kstest(p_values, "uniform").pvalue > 0.01


def test_searches_that_agree_are_one():
    """Claim: of searches that came to the same cost one goes on; the order is by cost, those without one last."""

    def iterate(cost):
        made = object.__new__(innovation_search.Iterate)
        made.__dict__["cost"] = cost
        return made

    nan = float("nan")
    found = innovation_search.distinct(iterate(cost) for cost in (nan, 9.0, 3.0, 9.2, 3.1, nan))
    assert [one.cost for one in found[:2]] == [3.0, 9.0]
    assert all(one.cost != one.cost for one in found[2:])


@pytest.mark.parametrize(("costs", "turns"), [((9.0, 5.0, 4.9, 0.0), 2), ((math.nan, math.nan, math.nan), 1)])
def test_alternations_end_where_the_cost_stays_or_is_not_a_number(monkeypatch, costs, turns):
    """Claim: parameters and disturbance alternate while the cost falls, and once where it is no number."""

    def iterate(number):
        made = object.__new__(innovation_search.Iterate)
        made.__dict__.update(cost=costs[number], number=number)
        return made

    search = innovation_search.InnovationSearch
    monkeypatch.setattr(search, "alternated", lambda self, one: iterate(one.__dict__["number"] + 1))
    assert object.__new__(search).converged(iterate(0)).__dict__["number"] == turns


@pytest.mark.long
def test_numbers_that_the_recordings_do_not_tell_are_of_the_order_of_the_files():
    """Claim: undriven, the drive's gain stays where it was, to ten times it, or to the file's own spread."""
    still = driven(oscillator(), 0.1 * np.arange(100), 0, amplitude=0.0)
    start = jnp.asarray([[0.5, 0.0]])
    for given, spread in ((2.0, 20.0), ({"value": 2.0, "prior_std": 0.3}, 0.3)):
        vehicle = oscillator(coefficients={"D_x": 0.6, "K_x": 4.0, "B_x_drive": given})
        led = look(fit(vehicle, synthetic(vehicle, [still], seed=3, start=start)))
        at = [row.name for row in vehicle.layout.free].index("B_x_drive")
        assert float(led.vehicle.values()["B_x_drive"]) == pytest.approx(2.0)
        assert np.sqrt(led.covariance[at, at]) == pytest.approx(spread, rel=1e-3)


def test_a_step_is_the_least_within_its_bounds():
    """Claim: no point within bounds leaves less than the step, one that is only cut off at them leaves more, and
    without bounds it is that of the normal equations."""
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((40, 4)) + 2.0 * rng.standard_normal((40, 1))
    gram = (whole := np.column_stack([columns @ [3.0, -2.0, 1.0, 0.5], columns])).T @ whole
    left = lambda step: step @ gram[1:, 1:] @ step - 2.0 * step @ gram[1:, 0]
    free = innovation_search._step(gram, 0.0, np.full(4, -np.inf), np.full(4, np.inf))
    assert free == pytest.approx([3.0, -2.0, 1.0, 0.5])
    low, high = np.full(4, -1.0), np.full(4, 1.0)
    step = innovation_search._step(gram, 0.0, low, high)
    assert np.all((step >= low) & (step <= high))
    assert left(step) < left(np.clip(free, low, high)) - 1.0
    assert all(left(step) <= left(point) for point in rng.uniform(low, high, (2000, 4)))
