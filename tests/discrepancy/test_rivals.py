"""How probable an explanation is beside another, by runs that were fitted and by runs that were not."""

import numpy as np
import pytest
from scipy import special

from jaxsub.discrepancy.rivals import told_apart
from jaxsub.discrepancy.show import HeldOut

SAMPLES = 480


def held(*expected):
    """A model that expects each sample of the held-out runs with these log likelihoods."""
    return HeldOut([], [], {}, [np.asarray(run, float) for run in expected], [])


def white(rng, gain, samples=SAMPLES):
    """(samples,) by how much the better of two models expects each sample more, where all errors are random."""
    each = 2.0 * gain / samples
    return 0.5 * each + np.sqrt(each) * rng.standard_normal(samples)


def exactly(rng, gain):
    """The same, of a sum that is as large as is to be expected."""
    found = white(rng, gain)
    return found - found.mean() + gain / SAMPLES


def test_where_noise_is_all_that_errs_stated_probabilities_are_calibrated():
    """Claim: of what is said to be probable by 0.6 to 0.9, and by more, so many are true, within 5 points."""
    rng = np.random.default_rng(3)
    stated, true = [], []
    for _ in range(4000):
        gain = rng.exponential(4.0)
        fitted, ahead = white(rng, 2.0 * gain, 2 * SAMPLES), white(rng, gain)
        first = rng.random() < 0.5
        sign = 1.0 if first else -1.0
        models = [held(np.ones(SAMPLES)), held(np.ones(SAMPLES) - sign * ahead)]
        found = special.softmax(told_apart([0.0, -sign * float(fitted.sum())], models, 2 * SAMPLES))
        stated.append(found.max())
        true.append((found[0] > 0.5) == first)
    stated, true = np.array(stated), np.array(true)
    for low, high in ((0.6, 0.9), (0.9, 0.99), (0.99, 1.0)):
        among = (stated >= low) & (stated <= high)
        assert np.mean(true[among]) == pytest.approx(np.mean(stated[among]), abs=0.05)


def test_where_parts_of_the_recordings_disagree_neither_is_certain():
    """Claim: a gain of 12 on runs like those fitted, +100 in one half of them and -88 in the other, leaves both."""
    rng = np.random.default_rng(5)
    parts = np.repeat(rng.permutation(np.repeat([100.0, -88.0], 12)) / 12.0 / 20.0, 20)
    leader = held(np.ones(SAMPLES))
    agreed, differing = (leader, held(1.0 - exactly(rng, 12.0))), (leader, held(1.0 - parts))
    alike = special.softmax(told_apart([0.0, -12.0], agreed, SAMPLES))
    apart = special.softmax(told_apart([0.0, -12.0], differing, SAMPLES))
    assert alike[0] > 0.99
    assert 0.5 < apart[0] < 0.75


def test_the_held_out_runs_decide_between_fits_of_the_same_evidence():
    """Claim: evidence of all runs is the sum; the order among several is kept, and one alone keeps its sum."""
    rng = np.random.default_rng(7)
    models = [held(1.0 - exactly(rng, 9.0)), held(np.ones(SAMPLES)), held(1.0 - exactly(rng, 30.0))]
    found = told_apart([5.0, 5.0, 5.0], models, SAMPLES)
    assert np.argsort(found).tolist() == [2, 0, 1]
    assert found[1] == 5.0 + SAMPLES
    assert told_apart([5.0], [held(np.full(10, 0.5))], 10) == [10.0]


def test_a_model_that_diverges_along_the_held_out_runs_is_none():
    """Claim: beside one that does not it has no evidence; where all diverge, they keep that of their fits."""
    lost, fine = held(np.full(SAMPLES, -np.inf)), held(np.zeros(SAMPLES))
    assert told_apart([90.0, 1.0], [lost, fine], SAMPLES) == [-np.inf, 1.0]
    assert told_apart([90.0, 1.0], [lost, lost], SAMPLES) == [90.0, 1.0]
    assert told_apart([-np.inf, 1.0], [fine, fine], SAMPLES) == [-np.inf, 1.0]
