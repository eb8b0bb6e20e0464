"""Splitting a run divides its time and loses no sample; the last run, or the end of a single one, is held out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording import Recording, hold_out, split


def make(times, name="run"):
    times = np.array(times, float)
    return Recording(name, times, {"u": times**2}, f"{name}.csv")


@settings(derandomize=True, deadline=None)
@given(
    times=st.lists(st.integers(0, 1000), min_size=2, max_size=40, unique=True).map(sorted),
    fraction=st.floats(-0.5, 1.5),
)
def test_split_divides_in_time_or_is_refused(times, fraction):
    run = make(times)
    try:
        first, rest = split(run, fraction)
    except InputError as error:
        early = np.sum(run.times <= run.times[0] + fraction * run.duration)
        assert min(early, len(times) - early) < 2
        assert str(error).startswith("run.csv: dividing it at ")
        return
    assert np.array_equal(np.concatenate([first.times, rest.times]), run.times)
    assert np.array_equal(np.concatenate([first.column("u"), rest.column("u")]), run.column("u"))
    assert first.times[-1] <= run.times[0] + fraction * run.duration < rest.times[0]
    assert rest.first_row == 2 + len(first.times)


def test_split_is_by_time_not_by_sample_count():
    first, rest = split(make([0.0, 1.0, 2.0, 3.0, 4.0, 80.0, 100.0]))
    assert (len(first.times), len(rest.times)) == (5, 2)


def test_fraction_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="leaves 0 and 10 samples"):
        split(make(range(10)), float("nan"))


def test_last_run_is_held_out():
    runs = [make(range(5), name) for name in "abc"]
    train, held = hold_out(runs)
    assert [run.name for run in train] == ["a", "b"]
    assert [run.name for run in held] == ["c"]


def test_end_of_a_single_run_is_held_out():
    (train,), (held,) = hold_out([make(range(11))])
    assert train.times[-1] == 7.0
    assert held.times[0] == 8.0


def test_no_run_is_refused():
    with pytest.raises(InputError, match="none was given"):
        hold_out([])
