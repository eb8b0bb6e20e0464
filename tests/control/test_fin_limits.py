"""A fin never goes further or faster than its limits, and does what it is told whenever they allow it."""

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.control import FinLimits
from jaxsub.errors import InputError

commands = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=20)
positive = st.floats(1e-3, 2.0) | st.just(np.inf)
apply = jax.jit(FinLimits.apply)


def followed(limits, told, dt):
    at = [0.0]
    for command in told:
        at.append(float(apply(limits, command, at[-1], dt)))
    return np.array(at)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(commands, positive, positive, st.floats(0.01, 1.0))
def test_amplitude_and_rate_are_never_exceeded(told, amplitude, rate, dt):
    at = followed(FinLimits.of(amplitude, rate), told, dt)
    assert np.abs(at).max() <= amplitude * (1.0 + 1e-12)
    assert np.abs(np.diff(at)).max() <= rate * dt * (1.0 + 1e-12) + 1e-15


@settings(derandomize=True, max_examples=60, deadline=None)
@given(commands, positive, positive, st.floats(0.01, 1.0))
def test_fin_ends_as_near_to_its_command_as_the_limits_allow(told, amplitude, rate, dt):
    at = followed(FinLimits.of(amplitude, rate), told, dt)
    for before, after, command in zip(at[:-1], at[1:], told, strict=True):
        low, high = max(-amplitude, before - rate * dt), min(amplitude, before + rate * dt)
        nearest = low if command < low else high if command > high else command
        assert after == pytest.approx(nearest, abs=1e-12)


@pytest.mark.parametrize(("amplitude", "rate"), [(0.0, 1.0), (0.3, -1.0), (float("nan"), 1.0)])
def test_limit_that_is_not_positive_is_refused(amplitude, rate):
    with pytest.raises(
        InputError, match=r"^fin limits: (amplitude|rate): .* is not positive; inf stands for no limit$"
    ):
        FinLimits.of(amplitude, rate)
