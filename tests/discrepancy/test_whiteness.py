"""Whether innovations are white, rarely denied where they are, and what their past tells where they are not."""

import numpy as np
import pytest

from jaxsub.discrepancy.linearise.whiteness import memory
from jaxsub.likelihood.whiteness import portmanteau, remembered


def innovations(rho: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Two runs of three channels of unequal variance, the last correlated over time, a tenth of the samples missing."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=(2, 400, 3)) * np.array([1.0, 3.0, 0.2])
    for k in range(1, 400):
        white[:, k, 2] += rho * white[:, k - 1, 2]
    return white, rng.random(white.shape) > 0.1


def test_white_innovations_are_rarely_denied():
    """Claim: p below 0.05 in no more of 300 white records than chance allows, gaps and variances as they are."""
    p_values = np.array([portmanteau(*innovations(0.0, seed)) for seed in range(300)])
    # a correction for several windows that overlap is on the safe side
    assert np.mean(p_values < 0.05) < 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 300)
    assert np.all(p_values > 1e-4)


def test_correlated_neighbours_in_one_channel_are_seen():
    """Claim: a correlation of 0.25 in one of three channels has p below 1e-4 in nine of ten records."""
    assert np.mean([portmanteau(*innovations(0.25, seed)) < 1e-4 for seed in range(40)]) >= 0.9


def test_short_and_empty_records_say_nothing():
    """Claim: where nothing was measured, or too little for the shortest window, p is one."""
    white, measured = innovations(0.5, 1)
    assert portmanteau(white, np.zeros_like(measured)) == 1.0
    assert portmanteau(white[:, :8], measured[:, :8]) == 1.0


def test_what_the_past_tells_is_that_of_the_correlation():
    """Claim: χ² that the past takes is N ln 1/(1 - ρ²) of the correlated channel, and little of white ones."""
    white, measured = innovations(0.4, 1)
    everything = np.ones_like(measured)
    expected = 800 * np.log(1.0 / (1.0 - 0.4**2))
    assert abs(remembered(white, everything) - expected) < 0.35 * expected
    assert remembered(*innovations(0.0, 1)) < 30.0


def test_effects_that_explain_less_than_the_past_are_told_so():
    """Claim: the share of an effect falls from one to a half as what the past tells grows to what the effect gains."""
    white, measured = innovations(0.4, 2)
    told = remembered(white, measured)
    assert memory(white, measured, 99.0 * told).explained == pytest.approx(0.99)
    assert memory(white, measured, told).explained == pytest.approx(0.5)
    assert memory(white, measured, 0.0).explained == 0.0
