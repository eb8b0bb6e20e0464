"""What remains of test runs is distinguished from noise and from what follows an input, and from nothing else."""

import dataclasses

import numpy as np
import pytest
from rigs import oscillator
from scipy.signal import lfilter

from jaxsub.discrepancy.explain.validation import beyond_noise, correlation, remainders
from jaxsub.recording import Recording
from jaxsub.simulation.manoeuvres import prbs
from jaxsub.vehicle import Output

DT, RUNS = 0.2, 2
LAYOUT = dataclasses.replace(
    oscillator().layout, inputs=(("fin", "fin"),), environment=(("thrust", "thrust"),), outputs=(Output("x", 0.5),)
)
INPUTS = {
    "switched": lambda rng, count: prbs(count, 15, 0.2, int(rng.integers(1e6))),
    "wandering": lambda rng, count: np.cumsum(rng.normal(size=count)),
    "periodic": lambda rng, count: np.sin(0.06 * np.arange(count) + rng.uniform(0.0, 6.0)),
}


def left(memory, kind, seed, follows=0.0, count=600, later=3):
    """What remains of an autoregressive residual of rms 1 beside inputs of a kind, a tenth of the samples missing."""
    rng = np.random.default_rng(seed)
    recordings, errors = [], []
    for run in range(RUNS):
        length = count - 50 * run
        noise = lfilter([1.0], [1.0, -memory], rng.normal(size=length + 300))[300:] * np.sqrt(1.0 - memory**2)
        fin, thrust = (INPUTS[kind](rng, length) for _ in range(2))
        late = np.concatenate([np.zeros(later), fin[:-later]])
        x = np.where(rng.random(length) < 0.9, 0.0, np.nan)
        columns = {"fin": fin, "thrust": thrust, "x": x}
        recordings.append(Recording(f"run {run}", DT * np.arange(length), columns, "test"))
        errors.append(np.pad(0.5 * (noise + follows * late / np.std(late)), (0, count - length))[:, None])
    return remainders(errors, recordings, LAYOUT, np.array([0.5]))["x"]


def test_correlations_are_those_of_a_sum_over_pairs():
    """Claim: by Fourier transforms the same as by adding every pair in which both were measured."""
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(2, 3, 40))
    there, here = rng.random((2, 3, 40)) < 0.7
    found, pairs = correlation(np.where(there, a, 0.0), there, np.where(here, b, 0.0), here, 12)
    for place, lag in enumerate(range(-12, 13)):
        at = [(r, k) for r in range(3) for k in range(40) if 0 <= k + lag < 40 and there[r, k + lag] and here[r, k]]
        later, earlier = np.array([a[r, k + lag] for r, k in at]), np.array([b[r, k] for r, k in at])
        assert pairs[place] == len(at)
        assert found[place] == pytest.approx(later @ earlier / np.sqrt(later @ later * (earlier @ earlier)), abs=1e-12)


@pytest.mark.parametrize("kind", INPUTS)
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_what_goes_with_no_input_is_rarely_said_to(memory, kind):
    """Claim: p below 0.05 in no more than chance allows of 100 residuals, slow ones and slow inputs too."""
    chance = np.array([left(memory, kind, seed).independent for seed in range(100)])
    assert np.mean(chance < 0.05) < 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 100)


@pytest.mark.parametrize(("memory", "size"), [(0.0, 0.3), (0.9, 1.0)])
def test_what_goes_with_an_input_is_seen_and_when(memory, size):
    """Claim: what follows one input, 0.3 of white noise or 1 of slow noise, is seen in nine of ten, at its lag."""
    found = [left(memory, "switched", seed, size) for seed in range(30)]
    right = [one.follows == "fin" and one.independent < 1e-3 for one in found]
    assert np.mean(right) >= 0.9
    either = np.concatenate([-found[0].delays[::-1], [0.0], found[0].delays])
    delays = [either[np.argmax(np.abs(one.inputs["fin"]))] for one in found]
    assert abs(np.median(delays) - 3 * DT) <= 1.01 * DT


def test_what_follows_an_input_late_is_seen_at_its_delay():
    """Claim: of what follows 100 samples later, a sixth of a run, the delay is told to a tenth."""
    found = left(0.0, "switched", 3, 1.0, later=100)
    longest = found.inputs["fin"][len(found.delays) + 1 :]
    assert found.follows == "fin" and found.independent < 1e-3
    assert found.delays[np.argmax(longest)] == pytest.approx(100 * DT, rel=0.1)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_intervals_cover_the_size(memory):
    """Claim: 95 % intervals of rms/σ hold its true value in 90 to 99 of 100, coloured or not."""
    found = [left(memory, "switched", seed) for seed in range(200)]
    assert 0.9 <= np.mean([one.low < 1.0 < one.high for one in found]) <= 0.99


def test_noise_is_random_and_what_remembers_is_not():
    """Claim: a correlation of 0.3 between neighbours shows in the test and in the first lag."""
    assert left(0.0, "switched", 1).random > 1e-2
    found = left(0.3, "switched", 1)
    assert found.random < 1e-6
    np.testing.assert_allclose(found.lagged[:2], [0.3, 0.09], atol=0.1)
    np.testing.assert_allclose(found.delays[[0, 1, -1]], [DT, 2 * DT, 150 * DT])


def test_more_than_noise_is_said_where_noise_is_stated():
    """Claim: a channel twice its stated noise that remembers is named, with the input; white noise of σ is not."""
    slow, white, led = left(0.6, "switched", 2), left(0.0, "switched", 2), left(0.0, "switched", 2, 1.0)
    grown = dataclasses.replace(slow, low=2.0 * slow.low, high=2.0 * slow.high)
    (line,) = beyond_noise({"x": grown}, {"x": 2.0}, LAYOUT)
    assert line.endswith("more than noise in x (2 σ).")
    assert beyond_noise({"x": led}, {"x": 1.4}, LAYOUT)[0].endswith("x (1.4 σ, with fin).")
    assert beyond_noise({"x": white}, {"x": 1.0}, LAYOUT) == []
    unstated = dataclasses.replace(LAYOUT, outputs=(Output("x"),))
    assert beyond_noise({"x": grown}, {"x": 2.0}, unstated) == []


def test_a_run_that_diverges_or_a_channel_never_measured_has_no_numbers():
    """Claim: they are no numbers and no warning, and inputs at rest are none to go with."""
    times = DT * np.arange(100)
    make = lambda x: Recording("run", times, {"fin": np.full(100, 0.1), "thrust": np.zeros(100), "x": x}, "test")
    wild = np.where(times > 9.0, np.inf, 1.0)[:, None]
    for error, x in ((wild, np.zeros(100)), (np.ones((100, 1)), np.full(100, np.nan))):
        found = remainders([error], [make(x)], LAYOUT, np.ones(1))["x"]
        assert np.isnan([found.low, found.random, found.independent]).all()
    still = remainders([np.ones((100, 1))], [make(np.zeros(100))], LAYOUT, np.ones(1))["x"]
    assert (still.inputs, still.follows, still.independent) == ({}, None, 1.0)
