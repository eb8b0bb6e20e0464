"""Frequencies at which a force stands out of its surroundings."""

import numpy as np
import pytest

from jaxsub.discrepancy.linearise.tones import tones

BAND = (0.2, 7.0)


def force(omega: float, size: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two runs, the second shorter and padded, of slow noise with a wave in the second equation of two."""
    rng = np.random.default_rng(seed)
    times = np.broadcast_to(0.2 * np.arange(800), (2, 800)) + rng.uniform(0.0, 0.02, (2, 800))
    live = np.arange(800) < np.array([[800], [600]])
    noise = np.zeros((2, 800, 2))
    for k in range(1, 800):
        noise[:, k] = 0.95 * noise[:, k - 1] + np.sqrt(1.0 - 0.95**2) * rng.normal(size=(2, 2))
    noise[..., 1] += size * np.sin(omega * times + 0.4)
    return noise * live[..., None], times, live


@pytest.mark.parametrize("omega", [0.31, 0.9, 1.4, 5.3])
def test_a_wave_comes_first_within_a_quarter_of_what_the_record_resolves(omega):
    """Claim: a wave as large as slow noise is the first tone of its equation, wherever in the band it is."""
    found, count = tones(*force(omega, 1.0, 3), BAND)
    assert abs(found[1][0] - omega) < 0.25 * 2.0 * np.pi / 160.0
    assert count == pytest.approx((BAND[1] - BAND[0]) * 160.0 / (2.0 * np.pi), rel=0.03)


def test_tones_are_few_apart_and_inside_the_band():
    """Claim: at most four, closer to each other than no record can resolve, none outside the band."""
    for own in tones(*force(2.0, 0.0, 5), BAND)[0]:
        assert 0 < len(own) <= 4
        assert all(BAND[0] <= w <= BAND[1] for w in own)
        assert np.min(np.abs(np.subtract.outer(own, own)) + 9.0 * np.eye(len(own))) > 2.0 * np.pi / 160.0


def test_equations_at_rest_and_an_empty_band_have_none():
    """Claim: no force has no tone, and where nothing can be resolved nothing is looked at."""
    quiet = np.zeros((1, 50, 2)), 0.2 * np.arange(50)[None], np.ones((1, 50), bool)
    assert tones(*quiet, BAND)[0] == [(), ()]
    assert tones(*quiet, (3.0, 2.0)) == ([(), ()], 0)
