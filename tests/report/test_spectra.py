"""The spectrum is Welch's where nothing is missing; with gaps it has the level of white noise, and keeps a line."""

import numpy as np
from scipy import signal

from jaxsub.report.spectra import spectrum

INTERVAL, COUNT = 0.2, 4096
TIMES = 7.0 + INTERVAL * np.arange(COUNT)


def test_without_gaps_it_is_scipys():
    """Claim: with half-overlapping Hann segments it is scipy.signal.welch, but for the mean and Nyquist's frequency."""
    noise = np.random.default_rng(0).normal(size=COUNT) + 3.0
    frequency, density = spectrum(TIMES, noise)
    length = COUNT // 4
    theirs = signal.welch(noise, 1.0 / INTERVAL, "hann", length, detrend="constant")
    np.testing.assert_allclose(frequency, theirs[0][1:-1], rtol=1e-12)
    np.testing.assert_allclose(density, theirs[1][1:-1], rtol=1e-9)


def test_white_noise_with_missing_samples_has_its_level():
    """Claim: with four samples in ten gone, and one long gap, the mean density is 2 Δ σ²."""
    make = np.random.default_rng(1)
    noise = np.where(make.random(COUNT) < 0.4, np.nan, make.normal(scale=0.5, size=COUNT))
    noise[1000:1900] = np.nan
    _, density = spectrum(TIMES, noise)
    np.testing.assert_allclose(density.mean(), 2.0 * INTERVAL * 0.25, rtol=0.06)


def test_a_line_stays_where_it_is():
    make = np.random.default_rng(2)
    wave = np.where(make.random(COUNT) < 0.3, np.nan, np.sin(2.0 * np.pi * 0.31 * TIMES))
    frequency, density = spectrum(TIMES, wave)
    assert abs(frequency[np.argmax(density)] - 0.31) < 1.0 / (INTERVAL * COUNT / 4)


def test_too_few_samples_have_none():
    assert spectrum(TIMES[:31], np.ones(31))[0].size == 0
    assert spectrum(TIMES, np.full(COUNT, np.nan))[1].size == 0
