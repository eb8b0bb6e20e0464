"""What is wrong with a stream of readings is counted, and the filter is told of it."""

import numpy as np
import pytest
from test_sensor_files import suite_of

from jaxsub.errors import InputError
from jaxsub.navigation.rows import rows_of
from jaxsub.navigation.suite.log import load_sensors, sensor_log
from jaxsub.recording import Recording

INERTIAL = "schema = 1\nmotion = { reach = 1.0 }\n[sensors.gyro]\ncolumn=['a','b','c']\n"
INERTIAL += "[sensors.accelerometer]\ncolumn=['d','e','f']\n"


def rows(columns=(), text="", times=None, gyro=""):
    times = 0.01 * np.arange(400) if times is None else times
    rng = np.random.default_rng(3)
    plain = {name: rng.normal(size=len(times)) for name in "abcdef"}
    suite = suite_of(INERTIAL.replace("'c']\n", f"'c']\n{gyro}\n") + text)
    return rows_of(sensor_log(Recording("run", times, plain | dict(columns), "run.csv"), suite), suite), plain


def found(rows, check):
    return [finding for finding in rows.findings if finding.check == check]


def test_short_gaps_are_interpolated_and_long_ones_are_unknown():
    """Claim: one missing sample is the mean of its neighbours; in half a second without any the turn is uncertain."""
    own = np.random.default_rng(4).normal(size=400)
    own[[50, *range(200, 250)]] = np.nan
    made, _ = rows({"a": own})
    np.testing.assert_allclose(made.rates[50, 0], 0.5 * (own[49] + own[51]))
    wide = made.samples.inputs.rate_std[:, 0]
    assert (wide[200:251] > 0.0).all() and not wide[:200].any() and not wide[251:].any()
    # what the intervals' errors add up to is an rms rate over half a second
    expected = np.nanstd(own) * np.sqrt(0.51 * 0.5)
    np.testing.assert_allclose(np.sqrt(np.sum((wide[200:251] * 0.01) ** 2)), expected, rtol=0.05)
    (finding,) = found(made, "missing-samples")
    assert finding.count == 51 and finding.severity == "warning" and "0.51 s" in finding.what


@pytest.mark.parametrize("stated", [True, False])
def test_a_gyro_at_its_stop_is_mistrusted(stated):
    """Claim: samples at the range, stated or shown by a flat top, are counted and the turn there is as uncertain."""
    turn = np.clip(21.0 * np.sin(0.05 * np.arange(400)), -20.0, 20.0)
    own = np.where(np.abs(turn) < 20.0, 0.1 * turn, turn)
    made, _ = rows({"a": own}, gyro="range = 20.0" if stated else "")
    at = np.abs(own) == 20.0
    (finding,) = found(made, "saturated")
    assert finding.count == at.sum()
    np.testing.assert_allclose(made.samples.inputs.rate_std[at, 0], 20.0)
    assert not made.samples.inputs.rate_std[:, 1:].any()


def test_rows_far_apart_are_a_gap():
    """Claim: two seconds without rows are reported, and the one interval across them is uncertain."""
    times = np.concatenate([0.01 * np.arange(200), 4.0 + 0.01 * np.arange(200)])
    made, _ = rows(times=times)
    (finding,) = found(made, "time-gap")
    assert finding.count == 1 and finding.times == ((1.99, 4.0),)
    assert np.flatnonzero(made.samples.inputs.rate_std[:, 0]).tolist() == [200]


def test_a_delay_moves_measurements_to_when_they_were_taken():
    """Claim: with a delay of 0.2 s a depth is in the row 0.2 s before its own; the first ones have no row."""
    depth = np.full(400, np.nan)
    depth[[5, 100]] = [1.0, 2.0]
    made, _ = rows({"z": depth}, "[sensors.depth]\ncolumn = 'z'\ndelay = 0.2\n")
    assert np.flatnonzero(made.samples.mask[:, 0]).tolist() == [80] and made.samples.outputs[80, 0] == 2.0


def test_an_error_that_lasts_is_told_as_white_noise_of_its_density():
    """Claim: measurements every 0.1 s whose errors last 2 s have √40 times their deviation; rate thins them."""
    made, _ = rows({"z": np.arange(400.0)}, "[sensors.depth]\ncolumn = 'z'\ncorrelation = 2.0\nrate = 10.0\n")
    at = np.flatnonzero(made.samples.mask[:, 0])
    assert (np.diff(at) == 10).all()
    np.testing.assert_allclose(made.samples.scale[at[1:], 0], np.sqrt(40.0))


def test_repeated_and_backward_rows_are_left_out_of_a_file(tmp_path):
    """Claim: of a file with 3 bad stamps the other rows are kept; one far ahead costs that row alone."""
    times = 0.1 * np.arange(60)
    times[[10, 20, 30]] = [times[9], times[15], 1e6]
    lines = "".join(f"{t!r},1,2,3,4,5,6\n" for t in times.tolist())
    (tmp_path / "run.csv").write_text(f"t,a,b,c,d,e,f\n{lines}nan,1,2,3,4,5,6\n")
    log = load_sensors(tmp_path / "run.csv", suite_of(INERTIAL))
    np.testing.assert_array_equal(log.times, np.delete(times, [10, 20, 30]))
    (finding,) = [finding for finding in log.findings if finding.check == "disordered-times"]
    assert finding.count == 4 and "1 without a time, 2 repeat a time, 1 go back" in finding.what
    back = "".join(f"{t!r},1,2,3,4,5,6\n" for t in times[::-1].tolist())
    (tmp_path / "back.csv").write_text(f"t,a,b,c,d,e,f\n{back}")
    with pytest.raises(InputError, match="sort the rows"):
        load_sensors(tmp_path / "back.csv", suite_of(INERTIAL))


def test_an_interval_is_driven_by_the_mean_of_its_ends_or_by_the_reading_at_its_end():
    """Claim: `sampling` decides which, for the gyros alone where it is theirs."""
    for sampling in ("point", "mean"):
        made, plain = rows(gyro=f"sampling = '{sampling}'")
        driven = made.samples.inputs.inertial
        ends = plain["a"][1:] if sampling == "mean" else 0.5 * (plain["a"][1:] + plain["a"][:-1])
        np.testing.assert_allclose(driven.gyro[1:, 0], ends)
        np.testing.assert_allclose(driven.accelerometer[1:, 0], 0.5 * (plain["d"][1:] + plain["d"][:-1]))


def test_a_fields_error_lasts_for_as_long_as_nothing_turns():
    """Claim: ten seconds of rest count as one measurement in ten seconds, and a turn as white noise of the time."""
    times = 0.01 * np.arange(2000)
    turns = np.where(times < 10.0, 0.0, 1.0)
    field = dict.fromkeys("xyz", 1.0 + 0.01 * np.random.default_rng(5).normal(size=2000))
    text = "[sensors.magnetometer]\ncolumn=['x','y','z']\ncorrelation=1.0\n"
    made, _ = rows(field | {"a": turns, "b": 0.0 * turns, "c": 0.0 * turns}, text, times)
    scale = np.asarray(made.samples.scale)[:, 0]
    np.testing.assert_allclose(scale[100:900], np.sqrt(9.5 / 0.01), rtol=0.02)
    np.testing.assert_allclose(scale[1100:], np.sqrt(2.0 / 0.01), rtol=1e-6)
