"""The time of a run reaches its effects whoever steps the vehicle: the sampled step, an ODE solver, a filter, a flight.

The vehicle has a wave, thrust that fails, a lagged force, a mistimed sensor and one off the centre; what the sampled
step makes of it is compared with the others, and has a derivative in every number.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked

from jaxsub.control import Autopilot, fly
from jaxsub.effects import (
    ActuatorRateLimit,
    FluidMemory,
    SensorDelay,
    SensorDrift,
    SensorLeverArm,
    ThrustLoss,
    WaveForcing,
)
from jaxsub.errors import InputError
from jaxsub.filter.vehicle import VehicleProcess, samples
from jaxsub.parameters import number
from jaxsub.simulation import Sampled, at_rest, integrate, sampled_states, simulate, synthetic
from jaxsub.vehicle import vehicle_from
from jaxsub.vehicle.catalogue import nps_auv_ii

EFFECTS = (
    WaveForcing("yaw", number(900.0), number(-500.0), number(1.1)),
    WaveForcing("heave", number(-700.0), number(400.0), number(0.8)),
    FluidMemory("sway", number(-300.0), number(0.7)),
    SensorDrift("r", number(1e-3)),
    SensorLeverArm("z", "x", number(1.5)),
)


def troubled(*more):
    vehicle = nps_auv_ii()
    for effect in (*EFFECTS, *more):
        vehicle = vehicle.with_effect(effect)
    return vehicle


def answers(vehicle, count=41):
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(count), seed=i, hold=7) for i in (1, 2)])
    start = at_rest(vehicle, 2)
    return runs, start, np.asarray(sampled_states(vehicle, runs, start))


def test_sampled_step_is_the_continuous_model():
    vehicle = troubled()
    runs, start, states = answers(vehicle)
    exact = np.asarray(integrate(vehicle, runs, start))
    plain = answers(nps_auv_ii())[2]
    assert np.abs(exact[..., : plain.shape[-1]] - plain).max() > 0.01
    np.testing.assert_allclose(states, exact, atol=1e-4 * np.abs(exact).max())


def test_a_filters_process_steps_and_shows_the_same():
    vehicle = troubled()
    runs, start, states = answers(vehicle)
    process, given = VehicleProcess.of(vehicle), samples(runs)
    shown = np.asarray(simulate(vehicle, runs, start))
    step, observe = eqx.filter_jit(process.step), eqx.filter_jit(process.observe)
    state, theta = start[1], process.coordinates()
    for k in range(41):
        sample = jax.tree.map(lambda leaf, k=k: leaf[1, k], given)
        state = step(state, theta, sample)
        np.testing.assert_allclose(state, states[1, k], rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(observe(state, theta, sample), shown[1, k], rtol=1e-8, atol=1e-9)


def test_a_flight_meets_the_same_wave_as_its_open_loop():
    vehicle, times = troubled(ActuatorRateLimit("rudder", number(0.2))), 0.25 * np.arange(61)
    run = fly(vehicle, Autopilot.of(vehicle), {"depth": np.full(61, 2.0)}, times, seed=1, noise=False)
    (again,) = synthetic(vehicle, [run], seed=1, noise=False, states=sampled_states)
    for column, values in again.columns.items():
        np.testing.assert_allclose(run.column(column), values, atol=1e-9, err_msg=column)


def test_what_remembers_samples_is_refused_where_none_are_kept():
    late = troubled(SensorDelay("r", number(0.3)))
    with pytest.raises(InputError, match="memory of sensor-delay"):
        VehicleProcess.of(late)
    with pytest.raises(InputError, match="memory of sensor-delay"):
        fly(late, Autopilot.of(late), {}, 0.25 * np.arange(5), seed=1)


def test_the_answer_has_a_derivative_in_every_number_of_every_effect():
    limited = ActuatorRateLimit("rudder", number(0.5))
    vehicle = troubled(SensorDelay("r", number(0.13)), limited)
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(31), seed=1, hold=7)])
    names = sorted(set(vehicle.values()) - set(vehicle.own_values()))
    at = jnp.stack([vehicle.values()[name] for name in names])

    @jax.jit
    def shown(vector):
        moved = vehicle.with_values(dict(zip(names, vector, strict=True)))
        states = Sampled.of(moved, runs).states(runs, at_rest(vehicle, 1))
        return moved.measure(runs.times, states, runs.signals)

    slope = np.asarray(jax.jacfwd(shown)(at))
    assert np.isfinite(slope).all()
    for i, name in enumerate(names):
        step = 1e-5 * max(1.0, abs(float(at[i]))) * np.eye(len(names))[i]
        quotient = np.asarray(shown(at + step) - shown(at - step)) / (2.0 * step[i])
        assert np.abs(quotient).max() > 0.0, name
        np.testing.assert_allclose(slope[..., i], quotient, atol=1e-4 * np.abs(quotient).max(), err_msg=name)


def test_thrust_fails_at_its_time():
    """Surge alone: m u̇ = X_u u + T, of which two fifths fail, has exponentials for its answer."""
    plain = vehicle_from(
        {"schema": 1, "name": "sled", "kind": "submerged-body", "dof": ["surge"], "body": {"mass": 10.0},
         "coefficients": {"X_u": -5.0}, "inputs": {"thrust": "T"}, "outputs": {"u": {"sigma": 0.01}}}, "sled.toml",
    )  # fmt: skip
    vehicle, times = plain.with_effect(ThrustLoss("thrust", 0.05, number(0.4), number(2.0))), 0.05 * np.arange(121)
    recording = driven(vehicle, times, seed=1)
    recording = dataclasses.replace(recording, columns={**recording.columns, "T": np.full(121, 8.0)})
    runs = stacked(vehicle, [recording])
    u = np.asarray(simulate(vehicle, runs, at_rest(vehicle, 1)))[0, :, 0]
    answer = lambda t, force: force / 5.0 * (1.0 - np.exp(-0.5 * np.maximum(t, 0.0)))
    away = np.abs(times - 2.0) > 0.2  # from the smooth step
    expected = answer(times, 8.0) - answer(times - 2.0, 3.2)
    np.testing.assert_allclose(u[away], expected[away], atol=5e-4)
