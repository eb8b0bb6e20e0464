"""A stream refuses wild measurements by default, counts them, and returns to the truth after a real jump."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from stream_cases import STOP, at, attitude_stream, counted, gentle_readings, started

from jaxsub.filter import ConstantNoise, ExtendedKalmanFilter, Open
from jaxsub.navigation.attitude import Gyro, RotationAttitude
from jaxsub.navigation.position import Course, DeadReckoning
from jaxsub.navigation.rotation import euler, exponential, product
from jaxsub.navigation.stream import Reading, Stream, follow

COUNT, SIGMA = 400, 1.0


def position_stream(**options):
    """Dead reckoning with a good log, so that a fix counts for little and a wrong filter forgets slowly."""
    root = jnp.eye(3)
    process = DeadReckoning(speed_std=0.05)
    return Stream(ExtendedKalmanFilter(process, ConstantNoise(0.02 * root), SIGMA * root, 20.0 * root), **options)


def voyage(jump=0.0, seed=0, count=COUNT):
    """North at 2 m/s, a fix a second; at the fix 200 the truth jumps by `jump` m. With it the true positions."""
    rng = np.random.default_rng(seed)
    time = np.arange(1.0, count + 1)
    true = np.outer(2.0 * time, [1.0, 0.0, 0.0])
    true[200:] += jump
    course = Course(jnp.full(count, 2.0), jnp.tile(jnp.eye(4)[0], (count, 1)), jnp.full((count, 3), 0.01))
    fixes = true + SIGMA * rng.normal(size=true.shape)
    return Reading(jnp.asarray(time), course, jnp.asarray(fixes), jnp.ones((count, 3), bool)), true


def run(stream, readings, x=(0.0, 0.0, 0.0)):
    state = stream.filter.start(jnp.asarray(x), jnp.zeros(0), jnp.zeros((0, 0)))
    last, seen = follow(stream, stream.start(state, at(readings, 0)), readings)
    return last.faults, seen


def with_outputs(readings, outputs):
    return dataclasses.replace(readings, outputs=jnp.asarray(outputs))


def test_consistent_readings_are_all_believed():
    readings, true = voyage()
    faults, seen = run(position_stream(), readings)
    assert counted(faults) == {}
    _, open_ = run(position_stream(gate=Open()), readings)
    np.testing.assert_allclose(seen.x, open_.x, atol=1e-11)
    assert np.abs(seen.x[-1] - true[-1]).max() < 1.5


@pytest.mark.parametrize("spike", [100.0, 1e6, -1e9, 1e300, np.nan, np.inf])
def test_spikes_leave_no_trace_and_are_counted(spike):
    readings, _ = voyage()
    outputs, where = np.array(readings.outputs), [50, 51, 120, 121, 122, 300]
    outputs[where, 1] = spike * np.array([1.0, 0.5, 1.0, -1.0, 0.3, 1.0])
    faults, seen = run(position_stream(), with_outputs(readings, outputs))
    name = "rejected" if np.isfinite(spike) else "outputs"
    assert counted(faults) == {name: 6}
    np.testing.assert_array_equal(getattr(faults, name), [0, 6, 0])
    assert not seen.used[jnp.asarray(where), 1].any()
    lacking = np.ones((COUNT, 3), bool)
    lacking[where, 1] = False
    _, expected = run(position_stream(), dataclasses.replace(readings, mask=jnp.asarray(lacking)))
    np.testing.assert_allclose(seen.x, expected.x, atol=1e-9)


@pytest.mark.parametrize("jump", [8.0, 30.0, 500.0, 1e4])
def test_after_a_real_jump_the_stream_returns_to_the_truth_and_says_so(jump):
    """With the tenth fix after it is believed; up to 25 standard deviations of the start its own deviations hold."""
    readings, true = voyage(np.array([0.0, jump, 0.0]))
    faults, seen = run(position_stream(), readings)
    np.testing.assert_array_equal(faults.rejected, [0, 5, 0])
    np.testing.assert_array_equal(faults.recoveries, [0, 1, 0])
    away = np.abs(np.asarray(seen.x) - true)[:, 1]
    assert away[215:].max() < 3.0 * SIGMA
    assert jump > 500.0 or (away[215:] < 5.0 * seen.x_std[215:, 1]).all()


def test_start_far_from_the_truth_is_left():
    readings, true = voyage()
    faults, seen = run(position_stream(), readings, (3000.0, -500.0, 0.0))
    assert counted(faults) == {"rejected": 10, "recoveries": 2}
    assert np.abs(seen.x[20:] - true[20:]).max() < 4.0 * SIGMA


def test_stream_of_wild_measurements_alone_stays_where_reckoning_leads_and_counts_them():
    readings, true = voyage()
    rng = np.random.default_rng(3)
    outputs = np.array(readings.outputs)
    outputs[100:300] = rng.choice([-1.0, 1.0], (200, 3)) * 10.0 ** rng.uniform(3.0, 9.0, (200, 3))
    faults, seen = run(position_stream(), with_outputs(readings, outputs))
    np.testing.assert_array_equal(faults.rejected, [200] * 3)
    assert counted(faults) == {"rejected": 600}
    assert (np.abs(seen.x - true) < 5.0 * seen.x_std + 0.1).all()
    assert (seen.x_std[299] > 1.3 * seen.x_std[99]).all()
    assert np.abs(seen.x[-1] - true[-1]).max() < 1.5


def test_sensor_that_sticks_at_a_wild_value_is_told_by_its_recovery():
    """It agrees with itself as a jump does; the count says that one or the other has happened."""
    readings, _ = voyage()
    outputs = np.array(readings.outputs)
    outputs[100:, 2] = 1e6
    faults, _ = run(position_stream(), with_outputs(readings, outputs))
    assert int(faults.recoveries[2]) >= 1
    assert int(faults.rejected[2]) >= 5


def test_spikes_in_angles_do_not_turn_an_attitude():
    """A million radians, which no gate sees before they are wrapped."""
    readings = gentle_readings(400, seed=4)
    process, root = RotationAttitude(STOP), jnp.diag(jnp.array([0.3] * 3 + [0.02] * 3))
    filter = ExtendedKalmanFilter(process, ConstantNoise(0.003 * jnp.eye(6)), jnp.diag(jnp.full(3, 0.03)), root)
    q, angles = jnp.array([1.0, 0, 0, 0]), []
    for rate in readings.inputs.rate:
        q = product(q, exponential(0.25 * rate))
        angles.append(euler(q))
    rng = np.random.default_rng(1)
    measured = np.array(angles) + 0.03 * rng.normal(size=(400, 3))
    measured[[43, 83, 123, 163]] = [1e6, -1e6, 1e6 + 1.0]
    readings = dataclasses.replace(readings, outputs=jnp.asarray(measured), scale=None)
    faults, seen = run(Stream(filter), readings, (1.0, 0, 0, 0, 0, 0, 0))
    assert int(faults.rejected.sum()) >= 8
    assert set(counted(faults)) == {"rejected"}
    found = jax.vmap(lambda x: euler(x[:4]))(seen.x)
    assert np.abs(found - np.array(angles))[40:].max() < 0.1


def test_gate_of_the_filter_is_kept():
    stream = attitude_stream()
    assert stream._gated() is stream.filter
    assert isinstance(dataclasses.replace(stream, gate=Open())._gated().gate, Open)
    readings = gentle_readings()
    last, seen = follow(stream, started(stream, readings), readings)
    assert counted(last.faults) == {} and bool(seen.used[3].all())
    assert isinstance(readings.inputs, Gyro)
