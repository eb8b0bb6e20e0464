"""The prior of initial states: first samples, at rest without, and wide where a sensor starts late."""

import numpy as np
import pytest
from rigs import oscillator, stacked

from jaxsub.estimate import initial_guess, rest, state_channels
from jaxsub.recording import Recording
from jaxsub.vehicle.catalogue import nps_auv_ii

TIMES = 0.5 * np.arange(80)


def guessed(x, x_rate):
    vehicle = oscillator()
    columns = {"f": np.zeros(80), "x": np.asarray(x, float), "x_rate": np.asarray(x_rate, float)}
    guess, spread = initial_guess(vehicle, stacked(vehicle, [Recording("run", TIMES, columns, "test")]))
    at = vehicle.layout.states.index("x")
    return float(guess[0, at]), float(spread[at])


@pytest.mark.parametrize("rate", [0.0, 3.0, -20.0])
@pytest.mark.parametrize("first", [1, 20, 60])
def test_a_late_first_sample_may_be_as_far_off_as_its_channel_changes_meanwhile(rate, first):
    """Claim: of a position that grows steadily the true initial state is within one standard deviation, not beyond."""
    position = 7.0 + rate * TIMES
    guess, spread = guessed(np.where(np.arange(80) < first, np.nan, position), np.full(80, rate))
    assert abs(guess - 7.0) <= spread * (1.0 + 1e-9)
    assert spread <= max(10.0, np.std(position[first:]), abs(rate) * TIMES[first]) * (1.0 + 1e-9)


def test_a_channel_that_was_never_measured_leaves_its_state_at_rest():
    """Claim: a body without a sample of its speed starts at its operating speed, not at zero."""
    vehicle = nps_auv_ii()
    layout = vehicle.layout
    columns = {name: np.zeros(80) for name in (*layout.held, *layout.interpolated)}
    columns |= {name: np.full(80, np.nan) for name in layout.channels}
    guess, spread = initial_guess(vehicle, stacked(vehicle, [Recording("run", TIMES, columns, "test")]))
    np.testing.assert_array_equal(guess, rest(vehicle, 1))
    assert float(guess[0, layout.states.index("u")]) == float(vehicle.own_values()["speed"]) > 0.0
    assert np.all(np.asarray(spread) > 0.0)


def test_depth_measures_z():
    layout = nps_auv_ii().layout
    measured = state_channels(layout)
    assert set(measured.values()) <= set(layout.channels)
    assert all(channel in (name, "depth") for name, channel in measured.items())
