"""Faults of single samples and of clocks are found where they are, and in clean runs nothing is."""

import dataclasses

import numpy as np
import pytest
from check_cases import VEHICLES, changed, clean, found, vehicle_named, with_values

from jaxsub.checks import check


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("seed", range(3))
def test_clean_runs_raise_no_warning(name, seed):
    checked = check(vehicle_named(name), [clean(name, seed)])
    # some of these vehicles are unstable, which is true of them
    loud = [f.line() for f in checked.findings if f.severity != "note" and f.check != "unstable"]
    assert not loud, loud
    for column, values in clean(name, seed).columns.items():
        np.testing.assert_array_equal(checked.recordings[0].columns[column], values)


@pytest.mark.parametrize("value", [-32.768, -999.0, 9999.0, 1e35, 9.969209968386869e36, np.deg2rad(-999.0), 327.67])
@pytest.mark.parametrize("count", [2, 50])
def test_sentinels_are_masked_with_rows_and_count(value, count):
    rows = np.sort(np.random.default_rng(count).choice(600, count, replace=False))
    checked = check(vehicle_named("dsrv"), [with_values(clean("dsrv"), "w", rows, value)])
    (finding,) = found(checked, "sentinel")
    assert (finding.severity, finding.channel, finding.count) == ("warning", "w", count)
    assert f"{count} rows" in finding.what and "masked as sentinel" in finding.what
    assert finding.rows[0][0] == clean("dsrv").first_row + rows[0]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(checked.recordings[0].columns["w"])), rows)


def test_a_sentinel_in_an_input_is_an_error():
    (finding,) = found(
        check(vehicle_named("dsrv"), [with_values(clean("dsrv"), "delta_s", slice(5, 9), -999.0)]), "sentinel"
    )
    assert finding.severity == "error"


@pytest.mark.parametrize(("name", "value"), [("theta", 1500.0), ("w", 300.0), ("z", 1e5), ("q", 1e4)])
def test_a_value_that_cannot_be_is_masked_and_many_are_an_error(name, value):
    checked = check(vehicle_named("dsrv"), [with_values(clean("dsrv"), name, [7], value)])
    (finding,) = found(checked, "impossible-value")
    assert finding.severity == "warning" and np.isnan(checked.recordings[0].columns[name][7])
    spread = value * (1.0 + 0.1 * np.random.default_rng(0).standard_normal(600))
    (finding,) = found(check(vehicle_named("dsrv"), [changed(clean("dsrv"), **{name: spread})]), "impossible-value")
    assert finding.severity == "error" and "unit" in finding.remedy


def test_a_time_step_of_a_day_is_an_error():
    run = clean("dsrv")
    slow = dataclasses.replace(run, times=1e6 * run.times)
    (finding,) = found(check(vehicle_named("dsrv"), [slow]), "time-step")
    assert finding.severity == "error" and "ms" in finding.remedy


def test_a_hole_with_the_input_moving_cuts_the_run():
    run = clean("dsrv")
    times = run.times + 10.0 * (np.arange(600) >= 300)
    checked = check(vehicle_named("dsrv"), [dataclasses.replace(run, times=times)])
    (finding,) = found(checked, "time-gap")
    assert finding.severity == "warning" and finding.rows == ((301, 302),) and "10.1 s" in finding.what
    assert [len(part.times) for part in checked.recordings] == [300, 300]
    assert [part.first_row for part in checked.recordings] == [2, 302]


def test_a_hole_with_inputs_at_rest_is_noted_and_the_run_stays_whole():
    run = clean("dsrv")
    rudder = run.columns["delta_s"].copy()
    rudder[250:350] = 0.1
    times = run.times + 2.0 * (np.arange(600) >= 300)
    checked = check(vehicle_named("dsrv"), [dataclasses.replace(changed(run, delta_s=rudder), times=times)])
    (finding,) = found(checked, "time-gap")
    assert finding.severity == "note" and len(checked.recordings) == 1


def test_uneven_sampling_is_no_hole():
    run = clean("dsrv")
    times = np.cumsum(np.random.default_rng(0).uniform(0.05, 0.2, 600))
    assert not found(check(vehicle_named("dsrv"), [dataclasses.replace(run, times=times)]), "time-gap")


def test_the_same_run_twice_is_an_error_by_its_content():
    run = clean("dsrv")
    copy = dataclasses.replace(run, source="copy.csv", times=run.times + 5.0)
    for checked in (check(vehicle_named("dsrv"), [run, copy]), check(vehicle_named("dsrv"), [run], [copy])):
        (finding,) = found(checked, "same-run")
        assert finding.severity == "error" and finding.where == "copy.csv"
    assert not found(check(vehicle_named("dsrv"), [run, clean("dsrv", 1)]), "same-run")


def test_an_output_that_only_other_runs_have_is_noted():
    run, other = clean("dsrv"), clean("dsrv", 1)
    less = dataclasses.replace(other, columns={n: v for n, v in other.columns.items() if n != "w"})
    checked = check(vehicle_named("dsrv"), [run, less])
    (finding,) = found(checked, "absent-output")
    assert finding.severity == "note" and np.isnan(checked.recordings[1].columns["w"]).all()
    assert check(vehicle_named("dsrv"), [less]).errors


def test_a_sensor_that_starts_late_is_noted():
    checked = check(vehicle_named("dsrv"), [with_values(clean("dsrv"), "w", slice(0, 100), np.nan)])
    (finding,) = found(checked, "late-start")
    assert (finding.severity, finding.count) == ("note", 100)
