"""Whatever readings are like, a stream stays finite and counts what was wrong, in flight as off-line."""

import dataclasses
import shutil

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from stream_cases import STOP, altered, at, attitude_stream, counted, gentle_readings, same, spliced, started

from jaxsub.errors import InputError
from jaxsub.filter import ConstantNoise, RandomNoise, Sample
from jaxsub.navigation.attitude import Gyro
from jaxsub.navigation.compiled_step import ahead_of_time, native
from jaxsub.navigation.stream import follow


def test_in_flight_and_off_line_say_the_same():
    """Here to the last bit; a compiler may fuse multiplication and addition differently in a loop and by itself."""
    readings = gentle_readings()
    stream = attitude_stream()
    state = started(stream, readings)
    last, estimates = follow(stream, state, readings)
    program = ahead_of_time(stream, state, at(readings, 0))
    packed = program.pack(state)
    for k in range(40):
        packed, estimate = program.step(packed, at(readings, k))
        same(estimate, at(estimates, k), atol=1e-13)
    state = program.unpack(packed)
    same(state, last, atol=1e-13)
    assert counted(state.faults) == {}


@pytest.mark.long
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_step_in_c_says_the_same():
    """Through a start, measurements and their absence, and a reading that is passed over."""
    readings = spliced(gentle_readings(), 10, mask=jnp.ones(3, bool), **PASSED_OVER["behind"])
    stream = attitude_stream()
    state = started(stream, readings)
    last, estimates = follow(stream, state, readings)
    program = native(stream.step, state, at(readings, 0))
    packed = program.pack(state)
    for k in range(len(readings.time)):
        packed, estimate = program.step(packed, at(readings, k))
        same(estimate, at(estimates, k), atol=1e-12)
    same(program.unpack(packed), last, atol=1e-12)


def test_many_recordings_at_once_are_each_of_them():
    records = [gentle_readings(seed=seed) for seed in range(3)]
    readings = jax.tree.map(lambda *leaves: jnp.stack(leaves), *records)
    stream = attitude_stream()
    state = started(stream, records[0])
    _, many = jax.vmap(lambda readings: follow(stream, state, readings))(readings)
    for number, record in enumerate(records):
        same(at(many, number), follow(stream, state, record)[1], atol=1e-13)


def test_a_step_is_compiled_by_jax_jit():
    """Claim: `jax.jit(stream.step)` takes the method as it is, and says what the scanned step does."""
    readings = gentle_readings(4)
    stream = attitude_stream()
    state = started(stream, readings)
    step, last = jax.jit(stream.step), follow(stream, state, readings)[0]
    for k in range(4):
        state, _ = step(state, at(readings, k))
    same(state, last, atol=1e-13)


NAN3 = jnp.full(3, jnp.nan)
PASSED_OVER = {
    "untimed": {"time": jnp.asarray(jnp.nan)},
    "behind": {"time": jnp.asarray(3.1)},
    "broken": {"time": jnp.asarray(5.6), "inputs": Gyro(jnp.full(3, 1e300))},
}


@pytest.mark.parametrize("fault", PASSED_OVER)
def test_a_reading_passed_over_changes_nothing(fault):
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    last, estimates = follow(stream, state, readings)
    spoilt, seen = follow(stream, state, spliced(readings, 10, mask=jnp.ones(3, bool), **PASSED_OVER[fault]))
    assert counted(spoilt.faults) == {fault: 1}
    same(dataclasses.replace(spoilt, faults=last.faults), last)
    same(jnp.delete(seen.x, 11, axis=0), estimates.x)
    same(seen.x[11], seen.x[10], atol=1e-15)
    assert not seen.diverged[jnp.arange(41) != 11].any()


def test_at_a_duplicate_stamp_no_time_passes_and_no_channel_counts_twice():
    readings, stream = gentle_readings(), attitude_stream()
    readings = altered(readings, 11, mask=jnp.array([True, False, False]))
    state = started(stream, readings)
    twice, seen = follow(stream, state, spliced(readings, 11, mask=jnp.array([True, True, False])))
    assert counted(twice.faults) == {"duplicates": 1, "repeated": 1}
    np.testing.assert_array_equal(twice.faults.repeated, [1, 0, 0])
    np.testing.assert_array_equal(seen.used[11:13], [[True, False, False], [False, True, False]])
    # one after the other, which for sensors that err independently is at once, to second order of the correction
    _, once = follow(stream, state, altered(readings, 11, mask=jnp.array([True, True, False])))
    same(seen.x[12], once.x[11], atol=1e-3)
    assert np.abs(seen.x[11] - once.x[11]).max() > 5e-3


def test_a_duplicate_that_brings_nothing_new_is_forgotten():
    """Even by a rule that learns from what the last measurement did."""
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    last, _ = follow(stream, state, readings)
    again, _ = follow(stream, state, spliced(readings, 11, mask=jnp.ones(3, bool)))
    assert counted(again.faults) == {"duplicates": 1, "repeated": 3}
    same(again.filter, last.filter)


@pytest.mark.parametrize("number", [jnp.nan, jnp.inf])
def test_the_last_good_inputs_stand_in(number):
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    spoilt = altered(altered(readings, 5, inputs=Gyro(NAN3)), 6, inputs=Gyro(jnp.array([0.0, number, 0.0])))
    last, estimates = follow(stream, state, spoilt)
    assert counted(last.faults) == {"inputs": 2}
    good = at(readings, 4).inputs
    _, expected = follow(stream, state, altered(altered(readings, 5, inputs=good), 6, inputs=good))
    same(estimates, expected)


def test_measurements_that_are_no_numbers_are_left_out():
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    spoilt = altered(readings, 7, outputs=jnp.array([jnp.nan, 0.1, jnp.inf]))
    spoilt = altered(spoilt, 11, scale=jnp.array([0.0, jnp.nan, 1.0]))
    last, estimates = follow(stream, state, spoilt)
    assert counted(last.faults) == {"outputs": 4}
    np.testing.assert_array_equal(last.faults.outputs, [2, 1, 1])
    without = altered(spoilt, 7, outputs=jnp.array([0.0, 0.1, 0.0]), mask=jnp.array([False, True, False]))
    without = altered(without, 11, scale=jnp.ones(3).at[2].set(1.0), mask=jnp.array([False, False, True]))
    same(estimates, follow(stream, state, without)[1])


def test_across_a_gap_the_inputs_hold():
    """Ten minutes later the attitude is turned at the later reading's rate, and nothing but its uncertainty grew."""
    readings, stream = gentle_readings(), attitude_stream(ConstantNoise(1e-3 * jnp.eye(6)))
    state = started(stream, readings)
    gone = dataclasses.replace(readings, time=readings.time + jnp.where(jnp.arange(40) >= 20, 600.0, 0.0))
    last, estimates = follow(stream, state, gone)
    # a turn of ten minutes at one rate is not what these readings were made of: the gate refuses them until they agree
    assert {n: count for n, count in counted(last.faults).items() if n not in ("rejected", "recoveries")} == {"gaps": 1}
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(estimates))
    assert (estimates.x_std[20, :3] > 10.0 * estimates.x_std[19, :3]).all()
    sample = Sample(at(readings, 20).inputs, jnp.asarray(600.25), jnp.zeros(3), jnp.zeros(3, bool))
    same(estimates.x[20], stream.filter.process.step(estimates.x[19], jnp.zeros(0), sample), atol=1e-12)


def test_a_clock_set_back_is_believed_when_it_insists():
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    back = dataclasses.replace(readings, time=readings.time - jnp.where(jnp.arange(40) >= 15, 3.7, 0.0))
    last, estimates = follow(stream, state, back)
    # four seconds back, of which it has caught up by ten readings none
    assert counted(last.faults) == {"behind": 10, "restarts": 1}
    assert estimates.used[27:40:4].all()
    assert float(last.clock.time) == float(back.time[-1])


def test_a_gyro_at_its_stop_is_counted():
    readings, stream = gentle_readings(), attitude_stream()
    state = started(stream, readings)
    last, estimates = follow(stream, state, altered(readings, 9, inputs=Gyro(jnp.array([0.0, -STOP, 0.1]))))
    assert counted(last.faults) == {"saturated": 1}
    assert float(estimates.noise_std[9, 1]) > 0.25 * STOP > float(estimates.noise_std[9, 0])


def test_a_reading_of_another_shape_or_type_is_one_clear_error():
    readings, stream = gentle_readings(), attitude_stream()
    state, reading = started(stream, readings), at(readings, 0)
    program = ahead_of_time(stream, state, reading)
    packed = program.pack(state)
    wrong = (
        dataclasses.replace(reading, outputs=jnp.zeros(4), mask=jnp.zeros(4, bool), scale=jnp.ones(4)),
        dataclasses.replace(reading, outputs=reading.outputs.astype(jnp.float32)),
        dataclasses.replace(reading, scale=None),
    )
    for bad in wrong:
        with pytest.raises(InputError, match=r"^reading: not of the shapes and types .*; give arrays like") as caught:
            program.step(packed, bad)
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"^state: not of the shapes"):
        program.pack(dataclasses.replace(state, taken=jnp.zeros(4, bool)))
    assert bool(np.isfinite(program.step(packed, reading)[1].x).all())


def test_a_packed_state_is_the_same_to_the_bit():
    """Whole numbers, truth values and a random key among real numbers, all in the types that they had."""
    readings = gentle_readings(dtype=jnp.float32)
    key = jax.random.key_data(jax.random.key(2**31 + 5))
    stream = attitude_stream(RandomNoise(jnp.full(6, 1e-3, jnp.float32), key), jnp.float32)
    state, _ = follow(stream, started(stream, readings), readings)
    program = ahead_of_time(stream, state, at(readings, 0))
    again = program.unpack(program.pack(state))
    assert jax.tree.structure(again) == jax.tree.structure(state)
    for one, other in zip(jax.tree.leaves(again), jax.tree.leaves(state), strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
