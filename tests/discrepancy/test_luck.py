"""Whether what held-out runs gain is more than luck."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from diagnosis_cases import recorded, wrong

from jaxsub.discrepancy import batch
from jaxsub.discrepancy.show import HeldOut, hold, luck
from jaxsub.discrepancy.trial import Model, Tries
from jaxsub.discrepancy.verdict import NOTHING as NOTHING_SAID
from jaxsub.discrepancy.verdict import helped
from jaxsub.effects.hull_damping import CubicDamping
from jaxsub.likelihood import Disturbance


def shown(expected: np.ndarray, squares: np.ndarray) -> HeldOut:
    """Two held-out runs with the same log likelihoods and squared errors of each sample."""
    return HeldOut([], [], {}, [expected] * 2, [squares] * 2)


NOTHING = shown(np.zeros(480), np.ones(480))


def test_a_gain_everywhere_helps_and_one_in_a_single_place_is_luck():
    """Claim: the same log likelihood counts where it is gained all along and not where it is gained at once."""
    at_once = np.zeros(480)
    at_once[7] = 48.0
    helps = lambda expected: luck(NOTHING, shown(expected, np.ones(480)), True, freely=False)
    assert helps(np.full(480, 0.1)).helps
    assert not helps(at_once).helps
    assert helps(at_once).likelihood == pytest.approx(helps(np.full(480, 0.1)).likelihood)
    assert not luck(NOTHING, shown(np.full(480, 0.1), np.full(480, 1.1)), True, freely=False).helps
    assert not luck(NOTHING, shown(np.full(480, 0.1), np.ones(480)), False, freely=False).helps


def test_where_a_free_run_asked_a_free_run_judges():
    """Claim: half the squared errors stand though samples come less expected; not where they fall in one place."""
    outlier = np.full(480, 0.05)
    outlier[3] = -100.0
    half, once = np.full(480, 0.5), np.ones(480)
    once[:60] = 0.0
    judged = lambda expected, squares: luck(NOTHING, shown(expected, squares), True, freely=True)
    assert judged(outlier, half).helps
    assert judged(outlier, half).free == pytest.approx(0.5)
    assert not luck(NOTHING, shown(outlier, half), True, freely=False).helps
    assert not judged(outlier, once + np.where(np.arange(480) < 60, 0.0, 0.05)).helps
    assert not luck(NOTHING, shown(outlier, half), False, freely=True).helps


def test_what_is_begun_anew_more_often_tells_more():
    """Claim: a loss in 3 of 64 pieces leaves no doubt of the gain in others; in one of four quarters it does."""
    squares = np.full(480, 0.2)
    squares[[5, 50, 95]] = 66.2
    found = shown(np.zeros(480), squares)
    whole, anew = (luck(NOTHING, dataclasses.replace(found, pieces=pieces), True, freely=True) for pieces in (1, 64))
    assert whole.free == anew.free < 1.0
    assert anew.helps
    assert not whole.helps


class OneTry(Tries):
    """A candidate whose fit halves the errors of held-out runs, with the log evidence of its fit."""

    def __init__(self, evidence, freely):
        self.freely, self.values = freely, {(): 0.0, (3,): evidence}

    def model(self, numbers):
        return Model(None, None, shown(np.full(480, 0.1), np.full(480, 0.5)) if numbers else NOTHING, ())

    def sound(self, numbers):
        return True


@pytest.mark.parametrize(
    ("evidence", "freely", "stands"), [(1.0, False, True), (-1.0, False, False), (-1.0, True, True)]
)
def test_a_fit_that_training_runs_do_not_ask_for_does_not_stand(evidence, freely, stands):
    """Claim: what held-out runs gain by a fit with less log evidence than before is none, unless a free run asked."""
    assert OneTry(evidence, freely).gain([], [3]).helps is stands


def test_a_model_that_diverges_gains_nothing_and_one_that_does_no_more_gains():
    """Claim: where the improved model diverges in a held-out run it is refused, where the baseline did it is not."""
    lost = shown(np.full(480, -np.inf), np.full(480, np.inf))
    better = shown(np.full(480, 0.1), np.full(480, 0.5))
    for freely in (False, True):
        assert not luck(NOTHING, lost, True, freely=freely).helps
        assert not luck(lost, lost, True, freely=freely).helps
        assert luck(lost, better, True, freely=freely).helps
    said = helped(NOTHING_SAID, CubicDamping("x", -1.0), luck(lost, better, True, freely=False)).notes
    assert said == ["Without cubic-damping[x] the model diverges along the held-out runs."]


def test_a_held_out_run_that_diverges_is_no_number_nowhere():
    """Claim: a vehicle that runs away on a held-out run errs without limit there, and is refused."""
    runs, sigma = batch(wrong(), recorded(None, 2)[:1]), jnp.array([output.sigma for output in wrong().layout.outputs])
    still = Disturbance(jnp.ones(2), jnp.ones(2), jnp.ones(len(sigma)))
    away = wrong().with_values({"M_q": jnp.asarray(1e8), "M_w": jnp.asarray(1e8)})
    before, after = (hold(vehicle, runs, [0], 1, sigma, still) for vehicle in (wrong(), away))
    assert np.isposinf(after.squares[0]).any()
    assert not any(np.isnan(part).any() for part in (*after.squares, *after.expected))
    for freely in (False, True):
        assert not luck(before, after, True, freely=freely).helps
