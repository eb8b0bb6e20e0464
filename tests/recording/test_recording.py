"""A Recording refuses samples that would mislead a fit, naming the row, and keeps its gaps when cut or resampled."""

import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import Recording

NAN = np.nan


def make(times=(0.0, 1.0, 2.0, 4.0), **columns):
    return Recording("run", np.array(times), {k: np.array(v) for k, v in columns.items()}, "run.csv")


@pytest.mark.parametrize(
    ("times", "row"),
    [
        ((0.0, NAN, 2.0), 3),
        ((0.0, 1.0, np.inf), 4),
        ((0.0, 1.0, 1.0, 1.0), 4),
        ((0.0, 2.0, 1.0), 4),
        ((-1e308, 1e308, 0.0), 4),
    ],
)
def test_bad_time_is_refused_with_its_row(times, row):
    with pytest.raises(InputError, match=rf"^run\.csv, row {row}: .*time"):
        make(times)


@pytest.mark.parametrize("times", [(), (1.0,), [[0.0, 1.0], [2.0, 3.0]]])
def test_fewer_than_two_samples_or_a_table_of_times_is_refused(times):
    with pytest.raises(InputError, match=r"^run\.csv: has . samples"):
        make(times)


def test_infinite_sample_is_refused_with_row_and_column():
    with pytest.raises(InputError, match=r"^run\.csv, row 4, column 'u': an infinite sample"):
        make(u=[0.0, NAN, -np.inf, 1.0])


def test_column_of_another_length_is_refused():
    with pytest.raises(InputError, match=r"column 'u': has shape \(2,\) beside 4 times"):
        make(u=[0.0, 1.0])


@pytest.mark.parametrize("name", ["", " u", "u\n", "u[m]", "t"])
def test_name_that_a_header_cannot_hold_is_refused(name):
    with pytest.raises(InputError, match="cannot be a column name"):
        make(**{name: [0.0] * 4})


def test_samples_are_float64_copies_that_cannot_be_changed():
    given = np.arange(4)
    run = Recording("run", given, {"u": given}, "run.csv")
    given[0] = 9
    assert run.column("u").dtype == np.float64
    assert run.column("u")[0] == run.times[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        run.column("u")[0] = 1.0


def test_missing_column_is_answered_with_the_nearest():
    with pytest.raises(InputError, match=r"has no column 'delta_R'; did you mean 'delta_r'\?"):
        make(u=[0.0] * 4, delta_r=[0.0] * 4).column("delta_R")
    with pytest.raises(InputError, match="its columns are u, v"):
        make(u=[0.0] * 4, v=[0.0] * 4).column("rudder")


def test_inputs_are_side_by_side_in_the_order_asked():
    run = make(a=[1, 2, 3, 4], b=[5, 6, 7, 8])
    assert np.array_equal(run.inputs(["b", "a"]), [[5, 1], [6, 2], [7, 3], [8, 4]])
    assert run.inputs([]).shape == (4, 0)


def test_gap_in_an_input_is_refused_with_the_row_of_the_file_even_after_a_cut():
    run = make(a=[1.0, 2.0, NAN, 4.0])
    for part in (run, run.between(1.0, 9.0)):
        with pytest.raises(InputError, match=r"^run\.csv, row 4, column 'a': a gap in an input"):
            part.inputs(["a"])


def test_between_keeps_both_ends():
    part = make(a=[1, 2, 3, 4]).between(1.0, 4.0)
    assert np.array_equal(part.times, [1.0, 2.0, 4.0])
    assert np.array_equal(part.column("a"), [2, 3, 4])
    assert part.duration == 3.0
    with pytest.raises(InputError, match="has 0 samples"):
        part.between(5.0, 6.0)


def test_resample_interpolates_columns_holds_inputs_and_keeps_gaps():
    run = make(a=[0.0, 2.0, NAN, 8.0], b=[0.0, 2.0, 4.0, 8.0])
    times = np.array([-1.0, 0.0, 0.5, 1.0, 1.5, 3.0, 5.0])
    again = run.resample(times, held=["b"])
    assert np.array_equal(again.times, times)
    np.testing.assert_array_equal(again.column("a"), [NAN, 0.0, 1.0, 2.0, NAN, NAN, NAN])
    np.testing.assert_array_equal(again.column("b"), [NAN, 0.0, 0.0, 2.0, 2.0, 4.0, 8.0])
    np.testing.assert_array_equal(run.resample(times).column("b"), [NAN, 0.0, 1.0, 2.0, 3.0, 6.0, NAN])


def test_resample_refuses_an_unknown_held_column_and_times_out_of_order():
    run = make(a=[0.0, 2.0, 3.0, 8.0])
    with pytest.raises(InputError, match="has no column 'b'"):
        run.resample(run.times, held=["b"])
    with pytest.raises(InputError, match=r"^run\.csv \(resampled\), row 3"):
        run.resample(np.array([1.0, 0.0]))
