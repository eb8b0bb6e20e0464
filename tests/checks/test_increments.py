"""Changes of a channel against the integral of its rate, compared for several faults at once."""

import dataclasses

import numpy as np

from jaxsub.checks.increments import Windows, compared


def test_several_at_once_are_compared_as_each_alone_is_whatever_is_missing():
    generator = np.random.default_rng(3)
    times = 0.1 * np.arange(300)
    rate = np.cumsum(generator.standard_normal(300))
    values = 0.1 * np.cumsum(rate) + 0.05 * generator.standard_normal((4, 300))
    values[1, 100:130], values[2, :40] = np.nan, np.nan
    values[3, generator.random(300) < 0.3] = np.nan
    arms = [generator.standard_normal(300), generator.standard_normal((4, 300))]
    windows = Windows.of(times, values[0], rate)
    together = compared(times, values, rate, windows, arms, 0.5)
    assert together is not None
    for row in range(4):
        alone = compared(times, values[row], rate, windows, [arms[0], arms[1][row]], 0.5)
        for field in dataclasses.fields(together):
            np.testing.assert_allclose(getattr(together, field.name)[row], getattr(alone, field.name), rtol=1e-12)


def test_equal_sides_are_no_distance_apart_and_opposite_ones_one():
    times = 0.1 * np.arange(300)
    rate = np.cos(times)
    windows = Windows.of(times, np.sin(times), rate)
    equal, opposite = (compared(times, sign * np.sin(times), rate, windows) for sign in (1.0, -1.0))
    assert equal is not None and np.all(equal.distances < 1e-5)
    assert opposite is not None and np.all(opposite.distances == 1.0)
