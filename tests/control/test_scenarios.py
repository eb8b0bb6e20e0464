"""The two scenarios of the paper have its timing, and are flights that a vehicle would survive."""

import numpy as np
import pytest

from jaxsub.control import FinLimits, references, scenario_one, scenario_two
from jaxsub.errors import InputError
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100


@pytest.mark.parametrize("dt", [0.25, 0.1, 0.05])
def test_references_change_when_and_by_what_the_paper_says(dt):
    times = dt * np.arange(round(60.0 / dt))
    wanted = references(times)
    for name, every, step in (("depth", 5.0, 20.0), ("course_rate", 1.5, np.radians(40.0))):
        change = np.flatnonzero(np.diff(wanted[name])) + 1
        np.testing.assert_array_equal(change, round(every / dt) * np.arange(1, len(change) + 1))
        assert len(change) == np.ceil(60.0 / every) - 1
        np.testing.assert_allclose(np.abs(np.diff(wanted[name]))[change - 1], step)
    np.testing.assert_allclose(np.abs(wanted["course_rate"]), np.radians(20.0))
    assert not wanted["roll"].any()


@pytest.mark.parametrize("make", [nps_auv_ii, remus_100])
def test_scenario_one_is_flown_upright_and_shakes_both_planes(make):
    run, wanted = scenario_one(make(), seed=2)
    assert len(run.times) == len(wanted["depth"]) == 241
    assert np.abs(run.column("theta")).max() < np.radians(45.0)
    assert np.abs(run.column("phi")).max() < np.radians(10.0)
    # of sensor noise 0.2 °/s
    assert run.column("r").std() > 4.0 * 0.0035
    assert run.column("q").std() > 2.0 * 0.0035


def test_scenario_two_is_a_horizontal_and_a_vertical_run():
    horizontal, vertical = scenario_two(
        nps_auv_ii(), seed=2, limits=FinLimits.of(0.35, np.inf), rudder=0.2, elevator=0.1
    )
    for column, run, amplitude in (("delta_r", horizontal, 0.2), ("delta_er", vertical, 0.1)):
        np.testing.assert_array_equal(np.abs(run.column(column)), amplitude)
        assert set(np.flatnonzero(np.diff(run.column(column))) % 6) == {5}
    assert np.abs(horizontal.column("z")).max() < 0.3
    assert np.abs(horizontal.column("phi")).max() < np.radians(3.0)
    assert horizontal.column("delta_er").std() > 0.005
    np.testing.assert_array_equal(vertical.column("delta_el"), vertical.column("delta_er"))
    assert not vertical.column("delta_r").any()
    assert np.abs(vertical.column("theta")).max() < np.radians(45.0)


def test_scenarios_are_those_of_their_seed():
    for fly in (
        lambda seed: [scenario_one(nps_auv_ii(), seed=seed)[0]],
        lambda seed: scenario_two(nps_auv_ii(), seed=seed),
    ):
        first, again, other = fly(3), fly(3), fly(4)
        for a, b, c in zip(first, again, other, strict=True):
            for column, samples in a.columns.items():
                np.testing.assert_array_equal(samples, b.column(column))
            assert not np.array_equal(a.column("z"), c.column("z"))
    assert not np.array_equal(first[0].column("delta_r"), other[0].column("delta_r"))


@pytest.mark.parametrize(
    ("fly", "what"),
    [
        (lambda: scenario_one(nps_auv_ii(), dt=0.2, seed=1), r"^dt = 0\.2 s: does not divide 1\.5 s"),
        (lambda: scenario_one(nps_auv_ii(), dt=0.0, seed=1), r"^dt = 0 s: does not divide"),
        (lambda: scenario_two(nps_auv_ii(), hold=0.6, seed=1), r"does not divide 0\.6 s"),
        (lambda: scenario_two(dsrv(), seed=1), r"^DSRV: scenario II turns and dives"),
        (lambda: scenario_two(remus_100(), seed=1), r"^REMUS 100, scenario II, horizontal: is lost by"),
    ],
)
def test_scenario_that_cannot_be_flown_is_refused(fly, what):
    with pytest.raises(InputError, match=what):
        fly()
