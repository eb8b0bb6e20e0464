"""Autopilots bring a vehicle to what it can reach and keep it there, whatever the signs of its derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from control_cases import TIMES, body, flown, held, rolled
from rigs import oscillator

from jaxsub.control import Autopilot, CourseRate, Depth, FinLimits, Roll
from jaxsub.errors import InputError
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100

LIMITS = FinLimits.of()


@pytest.mark.parametrize("make", [nps_auv_ii, remus_100, dsrv])
@pytest.mark.parametrize("step", [5.0, -8.0])
def test_depth_settles_on_a_step_without_steady_error(make, step):
    # the REMUS is buoyant and has to fly nose down to stay level, which only an integral finds out
    error = flown(make(), held(depth=step)).column("z") / step - 1.0
    assert np.abs(error[TIMES > 50.0]).max() < 0.03
    assert abs(error[-1]) < 0.005
    assert error.max() < 0.05


@pytest.mark.parametrize(("make", "rate"), [(nps_auv_ii, 0.08), (nps_auv_ii, -0.05), (remus_100, 0.1)])
def test_course_rate_settles_on_a_rate_within_reach(make, rate):
    error = flown(make(), held(course_rate=rate)).column("r") / rate - 1.0
    assert np.abs(error[TIMES > 25.0]).max() < 0.03
    assert abs(error[-1]) < 0.002


def test_roll_returns_to_zero_in_a_turn_that_would_list_the_vehicle():
    vehicle = nps_auv_ii()
    pilot = Autopilot.of(vehicle)
    turn, start = held(course_rate=0.08), rolled(vehicle, 0.4)
    free = flown(vehicle, turn, dataclasses.replace(pilot, roll=None), start=start).column("phi")
    kept = flown(vehicle, turn, pilot, start=start).column("phi")
    assert abs(free[-1]) > np.radians(1.0)
    assert np.abs(kept[TIMES > 40.0]).max() < np.radians(0.5)
    assert abs(kept[-1]) < np.radians(0.1)


@pytest.mark.parametrize("make", [nps_auv_ii, remus_100])
def test_vehicle_is_kept_level_in_noise_also_one_that_diverges_by_itself(make):
    run = flown(make(), held(depth=0.0), noise=True)
    assert np.abs(run.column("z")).max() < 1.0
    assert np.abs(run.column("theta")).max() < 0.3
    assert np.abs(run.column("r")).max() < 0.1


def test_time_at_the_stops_does_not_wind_the_integral_up():
    def recovery(samples):
        reference = np.where(np.arange(len(TIMES)) < samples, 0.5, 0.0)
        return flown(nps_auv_ii(), {"course_rate": reference}).column("r")[samples : samples + 120]

    # after 30 s the turn is steady, so what follows may not depend on how long it went on
    np.testing.assert_allclose(recovery(120), recovery(240), atol=1e-3)


def test_signs_of_the_gains_follow_the_signs_of_the_derivatives():
    vehicle = nps_auv_ii()
    values = vehicle.own_values()
    mirrored = vehicle.with_own_values({name: -v for name, v in values.items() if "_delta_" in name})
    wanted = held(depth=3.0, course_rate=0.05)
    ours, theirs = (
        flown(vehicle, wanted, start=rolled(vehicle, 0.2)),
        flown(mirrored, wanted, start=rolled(vehicle, 0.2)),
    )
    for column in ("z", "phi", "theta", "r"):
        np.testing.assert_allclose(theirs.column(column), ours.column(column), atol=1e-9)
    for column in ("delta_r", "delta_er", "delta_el"):
        np.testing.assert_allclose(theirs.column(column), -ours.column(column), atol=1e-9)


def test_poles_of_one_degree_of_freedom_are_where_they_were_put():
    # by hand: (I_z - N_rdot) r' = N_r r + N_delta_r delta; its only eigenvalue is a
    yaw = body(["yaw"], {"N_rdot": -30.0, "N_r": -40.0, "N_delta_r": -90.0}, {"rudder": "delta_r"})
    a, b = -40.0 / 80.0, -90.0 / 80.0
    loop = CourseRate.of(yaw, LIMITS).loop
    poles = np.roots([1.0, b * float(loop.proportional) - a, b * float(loop.integral)])
    np.testing.assert_allclose(np.sort(poles.real), [0.75 * a, 0.75 * a], rtol=1e-6)

    # by hand: (I_x - K_pdot) p' = K_p p + z_B B phi + (K_delta_er - -K_delta_el) a
    values = {"K_pdot": -3.0, "K_p": -12.0, "K_delta_er": 4.0, "K_delta_el": 5.0, "M_q": -9.0, "M_delta_e": -1.0}
    fins = {"elevator_right": "delta_er", "elevator_left": "delta_el"}
    data = {"mass": 100.0, "inertia": [5.0, 40.0, 50.0], "speed": 2.0}
    data |= {"weight": 981.0, "buoyancy": 981.0, "centre_of_buoyancy": [0.0, 0.0, -0.02]}
    loop = Roll.of(body(["roll", "pitch"], values, fins, body=data), LIMITS).loop
    a, c, b = -12.0 / 8.0, -0.02 * 981.0 / 8.0, 9.0 / 8.0
    kp, ki, kd = (b * float(gain) for gain in (loop.proportional, loop.integral, loop.derivative))
    np.testing.assert_allclose(np.poly([0.5 * a, 0.5 * a, 0.125 * a]), [1.0, kd - a, kp - c, ki], rtol=1e-9)


def test_elevators_share_depth_and_roll_as_mean_and_difference():
    pilot = Autopilot.of(nps_auv_ii(), FinLimits.of(np.inf, np.inf))
    shown = {name: jnp.zeros(()) for name in ("z", "theta", "q", "phi", "p", "r")}
    wanted = {name: jnp.zeros(()) for name in ("course_rate", "depth", "roll")}

    def fins(**changes):
        changed = shown | {name: jnp.asarray(value) for name, value in changes.items()}
        done = pilot.command(pilot.init(), changed, wanted, 0.25)[1]
        return np.array([float(done[name]) for name in ("rudder", "elevator_right", "elevator_left")])

    rolling, diving = fins(p=0.01), fins(theta=0.01)
    assert rolling[0] == 0.0 and rolling[1] == -rolling[2] != 0.0
    assert diving[0] == 0.0 and diving[1] == diving[2] != 0.0
    np.testing.assert_allclose(fins(p=0.01, theta=0.01), rolling + diving, atol=1e-15)


def test_command_is_pure_and_maps_over_a_batch():
    pilot = Autopilot.of(nps_auv_ii())
    rng = np.random.default_rng(1)
    shown = {name: jnp.asarray(0.1 * rng.standard_normal(4)) for name in ("z", "theta", "q", "phi", "p", "r")}
    wanted = {name: jnp.zeros(()) for name in ("course_rate", "depth", "roll")}
    once = lambda s: pilot.command(pilot.init(), s, wanted, 0.25)[1]
    batch = jax.jit(jax.vmap(once))(shown)
    for i in range(4):
        alone = once({name: value[i] for name, value in shown.items()})
        for name, value in alone.items():
            assert float(batch[name][i]) == pytest.approx(float(value), abs=1e-12)


def test_fin_that_is_overridden_keeps_its_limits():
    pilot = Autopilot.of(nps_auv_ii(), FinLimits.of(0.3, 0.4))
    zeros = {name: jnp.zeros(()) for name in ("z", "theta", "q", "phi", "p", "r", "course_rate", "depth", "roll")}
    memory, at = pilot.init(), []
    for _ in range(5):
        memory, done = pilot.command(memory, zeros, zeros, 0.25, {"rudder": jnp.asarray(1.0)})
        at.append(float(done["rudder"]))
    np.testing.assert_allclose(at, [0.1, 0.2, 0.3, 0.3, 0.3], atol=1e-12)


def test_vehicle_gets_the_autopilots_it_has_actuators_for():
    assert Autopilot.of(remus_100()).roll is None
    assert set(Autopilot.of(remus_100()).limits) == {"rudder", "stern_plane"}
    assert Autopilot.of(dsrv()).course is None


PITCH, YAW = {"M_q": -9.0, "Z_w": -9.0}, {"N_r": -9.0, "Y_v": -9.0}


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Autopilot.of(body(["yaw"], YAW, {})), "has nothing to steer yaw with; give it rudder under"),
        (lambda: Autopilot.of(body(["heave", "pitch"], PITCH, {})), "give it elevator_right and elevator_left or"),
        (lambda: Autopilot.of(oscillator()), "is free in neither yaw nor pitch"),
        (lambda: Autopilot.of(body(["yaw"], YAW, {"rudder": "d"})), "rudder: gives no yaw moment; give it N_delta_r"),
        (lambda: CourseRate.of(dsrv(), LIMITS), "is not free in yaw"),
        (lambda: Roll.of(remus_100(), LIMITS), "has nothing to steer roll with"),
        (lambda: Depth.of(body(["pitch"], {"M_delta_s": 1.0}, {"stern_plane": "d"}), LIMITS, 0.5), "nothing damps its"),
    ],
)
def test_vehicle_that_cannot_be_steered_is_refused(make, what):
    with pytest.raises(InputError, match=what):
        make()
