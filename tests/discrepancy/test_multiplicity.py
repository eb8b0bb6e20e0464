"""The smallest p-value of many candidates is worth what simulation says, however much the candidates resemble."""

import numpy as np
import pytest
from scipy import stats

from jaxsub.discrepancy.propose.multiplicity import family_wise, independent_tests


def test_independent_candidates_count_as_many_as_they_are():
    """Claim: n orthogonal columns are n tests, whether each is a candidate or two are one with two columns."""
    G = np.eye(40)
    assert independent_tests(G, [[i] for i in range(40)], 1e-9) == pytest.approx(40.0, rel=0.15)
    assert independent_tests(G, [[2 * i, 2 * i + 1] for i in range(20)], 1e-9) == pytest.approx(20.0, rel=0.15)


def test_copies_of_one_candidate_are_one_test():
    """Claim: thirty equal columns are one test, and no candidate at all is one too."""
    assert independent_tests(np.ones((30, 30)), [[i] for i in range(30)], 1e-9) == pytest.approx(1.0, abs=0.15)
    assert independent_tests(np.zeros((0, 0)), [], 1e-9) == 1.0


@pytest.mark.parametrize("alike", [0.0, 0.9, 0.999])
def test_the_smallest_p_value_is_uniform_where_nothing_is_missing(alike):
    """Claim: at levels 1 and 5 % white noise is significant as often as stated; corrected by count it is less often."""
    rng = np.random.default_rng(7)
    columns = np.sqrt(alike) * rng.standard_normal((400, 1)) + np.sqrt(1.0 - alike) * rng.standard_normal((400, 50))
    columns = columns / np.linalg.norm(columns, axis=0)
    tests = independent_tests(columns.T @ columns, [[i] for i in range(50)], 1e-9)
    b = rng.standard_normal((6000, len(columns))) @ columns
    smallest = stats.chi2.sf(np.max(b**2, axis=1), 1)
    found = np.array([family_wise(p, tests) for p in smallest])
    assert np.mean(found < 0.01) == pytest.approx(0.01, abs=0.005)
    assert np.mean(found < 0.05) == pytest.approx(0.05, abs=0.015)
    if alike == 0.999:
        assert np.mean(50.0 * smallest < 0.05) < 0.02


def test_very_small_p_values_keep_their_digits():
    """Claim: 1 - (1 - p)^m is m p where that is small, and one where p is."""
    assert family_wise(1e-40, 60.0) == pytest.approx(6e-39, rel=1e-12)
    assert family_wise(1.0, 60.0) == pytest.approx(1.0)
