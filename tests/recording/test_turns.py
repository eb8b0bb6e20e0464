"""Whole turns of an angle are counted where a recording tells how many there are, and left alone where it does not."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from jaxsub.recording.turns import without_jumps


def wrapped(angle):
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi


@given(
    st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=60),
    st.floats(-3.0, 3.0),
    st.lists(st.booleans(), min_size=60, max_size=60),
)
def test_what_was_wrapped_goes_on_as_it_was_whatever_is_missing(changes, start, kept):
    # of what turns at most 0.2 rad a sample, up to six samples in a row may be missing
    angle = start + np.cumsum(changes)
    missing = [not here and i % 7 != 0 for i, here in enumerate(kept[: len(angle)])]
    recorded = np.where(missing, np.nan, wrapped(angle))
    found = without_jumps(np.arange(float(len(angle))), recorded)
    assert found is not None
    there = ~np.isnan(recorded)
    np.testing.assert_array_equal(np.isnan(found), ~there)
    # but for the turns of the first
    np.testing.assert_allclose((found - angle)[there], (found - angle)[there][0], atol=1e-12)
    assert found[there][0] == recorded[there][0]


def test_an_angle_without_jumps_is_left_as_it_is_to_the_last_digit():
    angle = 0.1 * np.arange(100) + 1e-3 * np.random.default_rng(0).standard_normal(100)
    np.testing.assert_array_equal(without_jumps(0.5 * np.arange(100), angle), angle)


def test_the_course_of_a_vehicle_that_lies_still_is_not_counted():
    course = np.random.default_rng(1).uniform(-np.pi, np.pi, 200)
    assert without_jumps(np.arange(200.0), course) is None


def test_a_gap_in_which_it_may_have_turned_about_is_no_place_to_count():
    times, angle = np.arange(100.0), wrapped(0.2 * np.arange(100.0))
    assert without_jumps(times, angle) is not None
    angle[40:50] = np.nan
    assert without_jumps(times, angle) is None


def test_nothing_measured_and_one_sample_are_no_matter():
    for angle in (np.full(5, np.nan), np.array([np.nan, 3.0, np.nan])):
        np.testing.assert_array_equal(without_jumps(np.arange(float(len(angle))), angle), angle)
