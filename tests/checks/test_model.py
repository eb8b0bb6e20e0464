"""Checks of the vehicle against its runs: modes, sampling, and inputs that do not move."""

import dataclasses

import numpy as np
import pytest
from check_cases import VEHICLES, changed, clean, found, vehicle_named

from jaxsub.checks import check


@pytest.mark.parametrize("name", VEHICLES)
def test_an_input_that_does_not_move_names_the_coefficients_that_act_through_it(name):
    vehicle = vehicle_named(name)
    actuator, column = vehicle.layout.inputs[0]
    run = clean(name)
    (finding,) = found(check(vehicle, [changed(run, **{column: np.zeros(len(run.times))})]), "input-at-rest")
    assert finding.severity == "warning" and actuator in finding.what
    symbol = {"rudder": "delta_r", "stern_plane": "delta_s", "drive": "drive"}[actuator]
    named = {row.name for row in vehicle.layout.free if row.name.endswith(f"_{symbol}")}
    assert named and all(row in finding.what for row in named)
    assert not any(row.name in finding.what for row in vehicle.layout.free if row.name not in named)


def test_an_input_that_moves_in_one_run_is_enough():
    still = changed(clean("dsrv", 1), delta_s=np.zeros(600))
    assert not found(check(vehicle_named("dsrv"), [clean("dsrv"), still]), "input-at-rest")


def test_an_unstable_baseline_is_named_with_its_growth():
    (finding,) = found(check(vehicle_named("remus"), [clean("remus")]), "unstable")
    assert finding.severity == "warning" and "+1.02 1/s" in finding.what
    for name in ("nps", "oscillator"):
        assert not found(check(vehicle_named(name), [clean(name)]), "unstable")


def test_sampling_slower_than_the_fastest_mode_is_named():
    run = clean("oscillator")
    slow = dataclasses.replace(run, times=20.0 * run.times)
    (finding,) = found(check(vehicle_named("oscillator"), [slow]), "sampling")
    assert finding.severity == "warning" and "4 times" in finding.what
    assert not found(check(vehicle_named("oscillator"), [run]), "sampling")
