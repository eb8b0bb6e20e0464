"""A flight is a recording like any other: its inputs, simulated open loop, give its outputs again."""

import numpy as np
import pytest
from control_cases import TIMES, concealing, flown, held

from jaxsub.control import Autopilot, FinLimits, fly
from jaxsub.effects.sensors import SensorBias, SensorDrift
from jaxsub.errors import InputError
from jaxsub.parameters import number
from jaxsub.recording import Recording, load, save
from jaxsub.simulation import at_rest, prbs, sampled_states, synthetic
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

WANTED = {"depth": np.where(TIMES < 40.0, 4.0, 1.0), "course_rate": np.where(TIMES < 20.0, 0.08, -0.05)}


@pytest.mark.parametrize("make", [nps_auv_ii, concealing])
@pytest.mark.parametrize("noise", [False, True])
def test_inputs_as_flown_give_the_outputs_again_in_open_loop(make, noise):
    vehicle = make()
    run = flown(vehicle, WANTED, noise=noise, seed=7)
    (again,) = synthetic(vehicle, [run], seed=7, noise=noise, states=sampled_states)
    assert set(run.columns) == set(again.columns)
    for column, samples in again.columns.items():
        np.testing.assert_allclose(run.column(column), samples, atol=1e-9, err_msg=column)


def test_autopilot_steers_by_what_the_sensors_show():
    run = flown(nps_auv_ii().with_effect(SensorBias("z", number(0.5))), held(depth=3.0))
    (truth,) = synthetic(nps_auv_ii(), [run], seed=1, noise=False, states=sampled_states)
    assert run.column("z")[-1] == pytest.approx(3.0, abs=0.02)
    assert truth.column("z")[-1] == pytest.approx(2.5, abs=0.02)


def test_rudder_is_the_one_that_a_loop_written_out_gives():
    limits = FinLimits.of(0.3, 0.4)
    pilot = Autopilot.of(nps_auv_ii(), limits)
    reference = 0.3 * np.sign(np.sin(0.3 * TIMES + 0.1)) * (TIMES < 60.0)
    # the drift has to be in what the loop was shown, not only in what was recorded
    run = flown(nps_auv_ii().with_effect(SensorDrift("r", number(1e-4))), {"course_rate": reference}, pilot, noise=True)
    kp, ki = float(pilot.course.loop.proportional), float(pilot.course.loop.integral)
    at, total, expected = 0.0, 0.0, []
    for wanted, r in zip(reference, run.column("r"), strict=True):
        asked = kp * (wanted - r) + total
        at = max(-0.3, min(0.3, max(at - 0.1, min(at + 0.1, asked))))
        step = ki * (wanted - r) * 0.25
        if abs(asked - at) < 1e-6 or (asked > at) != (step > 0.0):
            total += step
        expected.append(at)
    np.testing.assert_allclose(run.column("delta_r"), expected, atol=1e-9)


@pytest.mark.parametrize("make", [nps_auv_ii, remus_100])
def test_no_fin_goes_past_its_limits(make):
    run = flown(make(), WANTED, Autopilot.of(make(), FinLimits.of(0.3, 0.6)), noise=True)
    for column in make().layout.held:
        delta = run.column(column)
        assert np.abs(delta).max() <= 0.3 + 1e-12
        assert np.abs(np.diff(delta)).max() <= 0.6 * 0.25 + 1e-12


def test_given_column_is_flown_and_the_rest_is_steered():
    sequence = prbs(len(TIMES), 8, 0.2, 3)
    pilot = Autopilot.of(nps_auv_ii(), FinLimits.of(0.35, np.inf))
    run = flown(nps_auv_ii(), held(depth=2.0), pilot, given={"delta_r": sequence})
    np.testing.assert_array_equal(run.column("delta_r"), sequence)
    assert run.column("z")[-1] == pytest.approx(2.0, abs=0.1)


def test_noise_is_that_of_the_seed():
    fly_with = lambda seed: flown(nps_auv_ii(), WANTED, noise=True, seed=seed).columns
    first, again, other = fly_with(1), fly_with(1), fly_with(2)
    for column, samples in first.items():
        np.testing.assert_array_equal(samples, again[column])
    assert not np.array_equal(first["delta_r"], other["delta_r"])


def test_flight_that_starts_at_its_depth_stays_there():
    vehicle = nps_auv_ii()
    start = at_rest(vehicle, 1)[0].at[-1].set(50.0)
    run = flown(vehicle, held(depth=50.0), start=start)
    np.testing.assert_allclose(run.column("z"), 50.0, atol=1e-9)


def test_samples_may_be_uneven_and_the_file_loads_back(tmp_path):
    gaps = np.random.default_rng(1).choice((0.1, 0.2), 300)
    pilot = Autopilot.of(dsrv(), FinLimits.of(0.3, 0.2))
    run = fly(dsrv(), pilot, {"depth": np.full(300, 2.0)}, np.cumsum(gaps), seed=1)
    speed = np.abs(np.diff(run.column("delta_s"))) / gaps[1:]
    for gap in (0.1, 0.2):
        assert speed[gaps[1:] == gap].max() == pytest.approx(0.2)
    assert run.column("z")[-1] == pytest.approx(2.0, abs=0.2)
    save(run, tmp_path / "run.csv")
    loaded = load(tmp_path / "run.csv")
    assert isinstance(loaded, Recording)
    np.testing.assert_array_equal(loaded.column("delta_s"), run.column("delta_s"))


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"reference": {"dept": TIMES}}, r"^reference 'dept': .*did you mean 'depth'\?$"),
        ({"reference": {"depth": TIMES[1:]}}, r"has shape \(400,\) beside 401 times"),
        ({"given": {"rudder": TIMES}}, r"^given column 'rudder': NPS AUV II has none"),
        ({"given": {"delta_r": np.full(401, np.nan)}}, r"a gap in an input column"),
        ({"times": TIMES[:1]}, r"has 1 samples; a flight needs at least two"),
        ({"autopilot": Autopilot(None, None, None, {})}, r"^input 'delta_r': no autopilot of NPS AUV II moves it"),
    ],
)
def test_flight_that_is_not_fully_specified_is_refused(options, what):
    arguments = {"autopilot": Autopilot.of(nps_auv_ii()), "reference": {}, "times": TIMES} | options
    with pytest.raises(InputError, match=what):
        fly(nps_auv_ii(), **arguments, seed=1)


def test_vehicle_that_gets_lost_is_refused_and_not_recorded():
    with pytest.raises(InputError, match=r"^REMUS 100, flight: is lost by .* s: pitched or adrift by more than 60°"):
        flown(remus_100(), {}, given={"delta_s": np.full(len(TIMES), 0.1)})
