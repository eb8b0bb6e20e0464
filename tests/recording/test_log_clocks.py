"""Stamps and clocks of a log: what cannot be right is dropped with a warning or refused by name."""

import json

import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import load
from jaxsub.recording.logs import Series, merged

EPOCH = 1.7e9
TIMES = 0.1 * np.arange(100)


def series(times, values=None, unit=""):
    return Series(np.asarray(times, float), np.sin(times) if values is None else np.asarray(values, float), unit)


@pytest.mark.parametrize("held", [[], ["d"], ["r"]])
def test_clocks_since_boot_and_since_1970_are_refused(held):
    with pytest.raises(InputError, match=r"log: the columns have no time in common \(r from 0 .* d from 1700000000 to"):
        merged({"r": series(TIMES), "d": series(EPOCH + TIMES)}, "run", "log", held=held)


def test_two_groups_of_clocks_are_refused_too():
    groups = {"a": series(TIMES), "b": series(EPOCH + TIMES), "c": series(TIMES), "d": series(EPOCH + TIMES)}
    with pytest.raises(InputError, match=r"a, c from 0 to 9.9 s, b, d from 1700000000"):
        merged(groups, "run", "log", interpolated=["a", "b"])


def test_output_without_a_sample_is_refused_by_name():
    apart = {"r": series(TIMES), "d": series(20.0 + TIMES)}
    with pytest.raises(
        InputError, match=r"column 'r': has no sample in the rows from 20 to 29.9 s \(r from 0 to 9.9 s"
    ):
        merged(apart, "run", "log", held=["d"])


def test_command_given_once_before_the_run_is_held():
    run = merged({"r": series(5000.0 + TIMES), "d": series([0.0], [0.3])}, "run", "log", held=["d"])
    assert np.all(run.column("d") == 0.3)


@pytest.mark.parametrize("stray", [0.0, EPOCH + 86400.0, EPOCH - 86400.0])
@pytest.mark.parametrize("held", [[], ["r"]])
def test_one_stamp_far_off_is_reported_and_dropped(stray, held):
    times = EPOCH + TIMES
    times[40] = stray
    run = merged({"r": series(times, TIMES), "q": series(EPOCH + TIMES)}, "run", "log", held=held)
    assert run.duration < 10.0
    (finding,) = run.findings
    assert (finding.severity, finding.channel, finding.count) == ("warning", "r", 1)
    kept = run.column("r")[~np.isnan(run.column("r"))]
    assert 4.0 not in kept or held
    np.testing.assert_allclose(run.column("r")[-1], TIMES[-1])


def test_pauses_of_a_long_log_are_no_strays():
    times = np.concatenate([TIMES, 40000.0 + TIMES, 90000.0 + TIMES])
    run = merged({"r": series(times), "fix": series(times[::50])}, "run", "log")
    assert not run.findings and len(run.times) == 300


@pytest.mark.parametrize("unit", ["rad", ""])
def test_compass_through_north_is_interpolated_by_the_shorter_way(unit):
    heading = np.deg2rad([340.0, 350.0, 0.0, 10.0, 20.0])
    slow = series([0.0, 2.0, 4.0, 6.0, 8.0], heading, unit)
    run = merged({"psi": slow, "r": series(0.5 * np.arange(17))}, "run", "log", interpolated=["psi"])
    np.testing.assert_allclose(np.rad2deg(run.column("psi")), 340.0 + 2.5 * np.arange(17))


def test_other_columns_are_not_unwrapped():
    slow = series([0.0, 1.0, 2.0], [0.0, 6.0, 0.0], "m")
    run = merged({"psi": slow, "r": series(0.5 * np.arange(5))}, "run", "log", interpolated=["psi"])
    np.testing.assert_allclose(run.column("psi"), [0.0, 3.0, 6.0, 3.0, 0.0])


def test_rows_too_close_together_are_refused_at_once():
    with pytest.raises(InputError, match="set a longer `every`"):
        merged({"r": series(TIMES)}, "run", "log", every=1e-9)


def test_mcap_message_is_dated_by_its_log_time(tmp_path):
    writer = pytest.importorskip("mcap.writer")
    with (tmp_path / "flight.mcap").open("wb") as file:
        log = writer.Writer(file)
        log.start()
        key = log.register_channel("gyro", "json", log.register_schema("any", "jsonschema", b"{}"))
        for t in TIMES:
            log.add_message(key, round(1e9 * (EPOCH + t)), json.dumps({"r": t}).encode(), publish_time=0)
        log.finish()
    run = load(tmp_path / "flight.mcap", {"r": "gyro.r"})
    np.testing.assert_allclose(run.times, run.column("r"), atol=1e-6)
