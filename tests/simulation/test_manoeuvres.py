"""Manoeuvres have the shapes that their names say."""

import numpy as np

from jaxsub.simulation import doublet, prbs, square, three_two_one_one

TIMES = 0.1 * np.arange(101)


def test_square_wave_starts_positive_and_turns_every_half_period():
    wave = square(TIMES + 3.0, period=4.0, amplitude=0.2)
    np.testing.assert_array_equal(wave[[0, 19, 21, 39, 41]], [0.2, 0.2, -0.2, -0.2, 0.2])
    assert set(wave) == {0.2, -0.2}


def test_pulses_last_as_long_as_they_should():
    for manoeuvre, lengths in ((doublet, [1, -1]), (three_two_one_one, [3, -2, 1, -1])):
        expected = np.zeros(101)
        expected[20 : 20 + 10 * sum(map(abs, lengths))] = np.repeat(0.3 * np.sign(lengths), 10 * np.abs(lengths))
        np.testing.assert_array_equal(manoeuvre(TIMES, 2.0, 1.0, 0.3), expected)


def test_random_telegraph_signal_is_its_seeds_and_holds():
    signal = prbs(95, 10, 0.5, seed=7)
    assert signal.shape == (95,)
    assert set(signal) == {0.5, -0.5}
    np.testing.assert_array_equal(signal[:90].reshape(9, 10), np.repeat(signal[:90:10, None], 10, axis=1))
    np.testing.assert_array_equal(signal, prbs(95, 10, 0.5, seed=7))
    assert not np.array_equal(signal, prbs(95, 10, 0.5, seed=8))
