"""How probable an explanation is beside another, as far as blocks of the recordings agree."""

import numpy as np
import pytest
from scipy import special

from jaxsub.discrepancy.accept.cross_validation import Predicted
from jaxsub.discrepancy.accept.rivals import robust_log_evidence

BLOCKS = 48


def model(one_step):
    """A model that predicts blocks of the training runs with these log densities."""
    return Predicted(np.asarray(one_step, float), np.zeros(8))


def white(rng, gain):
    """(BLOCKS,) by how much the better of two models predicts each block better, where all errors are random."""
    each = 2.0 * gain / BLOCKS
    return 0.5 * each + np.sqrt(each) * rng.standard_normal(BLOCKS)


def exactly(rng, gain):
    """The same, of a sum that is as large as is to be expected."""
    found = white(rng, gain)
    return found - found.mean() + gain / BLOCKS


def test_where_noise_is_all_that_errs_stated_probabilities_are_calibrated():
    """Claim: of what is said to be probable by 0.6 to 0.9, and by more, so many are true, within 8 points, and no more
    than 3 points fewer."""
    rng = np.random.default_rng(3)
    stated, true = [], []
    for _ in range(4000):
        ahead = white(rng, rng.exponential(12.0))
        first = rng.random() < 0.5
        sign = 1.0 if first else -1.0
        models = [model(np.ones(BLOCKS)), model(np.ones(BLOCKS) - sign * ahead)]
        found = special.softmax(robust_log_evidence([0.0, -sign * float(ahead.sum())], models))
        stated.append(found.max())
        true.append((found[0] > 0.5) == first)
    stated, true = np.array(stated), np.array(true)
    for low, high in ((0.6, 0.9), (0.9, 0.99), (0.99, 1.0)):
        among = (stated >= low) & (stated <= high)
        assert np.mean(true[among]) == pytest.approx(np.mean(stated[among]), abs=0.08)
        assert np.mean(true[among]) > np.mean(stated[among]) - 0.03


def test_where_parts_of_the_recordings_disagree_neither_is_certain():
    """Claim: a gain of 12, in one half of the blocks +100 and -88 in the other, leaves both probable."""
    rng = np.random.default_rng(5)
    parts = rng.permutation(np.repeat([100.0, -88.0], BLOCKS // 2)) / (BLOCKS // 2)
    leader = model(np.ones(BLOCKS))
    agreed, differing = (leader, model(1.0 - exactly(rng, 12.0))), (leader, model(1.0 - parts))
    alike = special.softmax(robust_log_evidence([0.0, -12.0], agreed))
    apart = special.softmax(robust_log_evidence([0.0, -12.0], differing))
    assert alike[0] > 0.99
    assert 0.5 < apart[0] < 0.75


def test_the_order_of_several_is_kept():
    """Claim: the evidence of fits orders them, the best keeps its own, and one alone does."""
    rng = np.random.default_rng(7)
    models = [model(1.0 - exactly(rng, 9.0)), model(np.ones(BLOCKS)), model(1.0 - exactly(rng, 30.0))]
    found = robust_log_evidence([-9.0, 5.0, -30.0], models)
    assert np.argsort(found).tolist() == [2, 0, 1]
    assert found[1] == 5.0
    assert robust_log_evidence([5.0], [model(np.full(BLOCKS, 0.5))]) == [5.0]


def test_a_model_without_evidence_is_none():
    """Claim: beside one that has evidence it keeps none, and where all diverge they keep what they have."""
    fine = model(np.zeros(BLOCKS))
    assert robust_log_evidence([-np.inf, 1.0], [fine, fine]) == [-np.inf, 1.0]
    assert robust_log_evidence([-np.inf, -np.inf], [fine, fine]) == [-np.inf, -np.inf]
