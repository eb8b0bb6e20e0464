"""The paper's navigator is its parts in turn, finds attitude, bias and position, and survives whatever it is told."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from stream_cases import BIAS, STOP, G, at, counted, same

from jaxsub.filter import ConstantNoise, ExtendedKalmanFilter, FuzzyNoise, Sample
from jaxsub.navigation.attitude import AbstractAttitude, Gyro, PaperAttitude, RotationAttitude
from jaxsub.navigation.compiled_step import ahead_of_time
from jaxsub.navigation.constructed import constructed_over, standard_deviations
from jaxsub.navigation.navigator import FlightReading, PaperNavigator
from jaxsub.navigation.position import Course, DeadReckoning
from jaxsub.navigation.rotation import from_euler
from jaxsub.navigation.stream import Stream, follow


def navigator(kind: type[AbstractAttitude] = RotationAttitude, fuzzy=False, dtype=jnp.float64):
    """In the paper's proportions: fixes good to 0.1 m from one to the next, gyros of a bias of degrees a second."""
    array = lambda *values: jnp.asarray(values, dtype)
    ways = 6 if kind is RotationAttitude else 7
    roots = array(*[0.5] * (ways - 3), *[0.03] * 3)
    density = 0.02 * roots
    rule = FuzzyNoise(density, roots, width=4) if fuzzy else ConstantNoise(jnp.diag(density))
    attitude = ExtendedKalmanFilter(kind(STOP), rule, jnp.diag(array(0.1, 0.1, 0.1)), jnp.diag(roots))
    drift = ConstantNoise(jnp.diag(array(0.3, 0.3, 0.3)))
    position = ExtendedKalmanFilter(
        DeadReckoning(), drift, jnp.diag(array(3.0, 3.0, 5.0)), jnp.diag(array(9.0, 9.0, 9.0))
    )
    streams = Stream(attitude, Gyro(array(STOP, STOP, STOP))), Stream(position)
    return PaperNavigator(*streams, array(0.1, 0.1, 0.2), array(0.05, 0.05, 0.05))


def flight(count=160, seed=0, rate=(0.0, 0.0, 0.0), dtype=jnp.float64):
    """A straight climb at 15 m/s, four readings a second, a fix with each fourth."""
    rng = np.random.default_rng(seed)
    t = 0.25 * np.arange(1, count + 1)
    pitch, yaw = 0.3, 0.7
    ahead = np.array([np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)])
    gravity = -G * np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
    gyro = np.asarray(rate) + BIAS + 0.002 * rng.normal(size=(count, 3))
    accelerometer = gravity + 0.03 * rng.normal(size=(count, 3))
    fixes = 15.0 * ahead * t[:, None] + 0.05 * rng.normal(size=(count, 3))
    array = lambda values: jnp.asarray(values, dtype)
    present = jnp.asarray(np.arange(count) % 4 == 3)
    speed = 15.0 + 0.1 * rng.normal(size=count)
    return FlightReading(array(t), array(gyro), array(accelerometer), array(speed), array(fixes), present)


def navigator_start(system, readings, x=(1.0, 0, 0, 0, 0, 0, 0)):
    kind = readings.time.dtype
    empty = jnp.zeros(0, kind), jnp.zeros((0, 0), kind)
    attitude = system.attitude.filter.start(jnp.asarray(x, kind), *empty)
    position = system.position.filter.start(jnp.zeros(3, kind), *empty)
    return system.start(attitude, position, at(readings, 0))


def body_std(x, joint):
    """Of a rotation about the body's axes: six ways to change hold it, seven by δ = 2 Ξ(q)ᵀ δq."""
    if len(joint) == 7:
        w, x, y, z = x[:4]
        joint = 2.0 * jnp.array([[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]) @ joint[:4]
    return jnp.linalg.norm(joint[:3], axis=1)


@pytest.mark.parametrize("kind", [pytest.param(PaperAttitude, marks=pytest.mark.long), RotationAttitude])
def test_the_navigator_is_its_parts_one_after_the_other(kind):
    """Constructed over the recording, then filtered, then reckoned, each by itself."""
    system, readings = navigator(kind), flight()
    last, seen = follow(system, navigator_start(system, readings), readings)
    made = constructed_over(readings.time, readings.accelerometer, readings.fix, readings.present)
    same(seen.constructed, made, atol=1e-12)
    stds = system.position_std, system.accelerometer_std
    deviations = jax.vmap(lambda w: standard_deviations(w.fixes, w.times, w.accelerometer, *stds))(made.window)
    scale = jnp.where(made.known, deviations / 0.1, 1.0)
    elapsed = jnp.full(160, 0.25).at[0].set(0.0)
    start = navigator_start(system, readings)

    def alone(filter, state, samples):
        def one(state, sample):
            state, estimate = filter.step(state, sample)
            return state, (estimate, state.joint)

        return jax.lax.scan(one, state, samples)[1]

    samples = Sample(Gyro(readings.gyro), elapsed, made.angles, made.known, scale)
    attitude, joint = alone(system.attitude.filter, start.attitude.filter, samples)
    same(seen.attitude, attitude, atol=1e-11)
    course = Course(readings.speed, attitude.x[:, :4], jax.vmap(body_std)(attitude.x, joint))
    samples = Sample(course, elapsed, readings.fix, jnp.broadcast_to(readings.present[:, None], (160, 3)))
    position, _ = alone(system.position.filter, start.position.filter, samples)
    same(seen.position, position, rtol=1e-11, atol=1e-11)
    np.testing.assert_array_equal(seen.position.used[:, 0], readings.present)
    third = np.flatnonzero(readings.present)[2:]
    assert seen.attitude.used[third].all()
    assert int(seen.attitude.used.sum()) == 3 * len(third)
    assert counted(last.attitude.faults) == counted(last.position.faults) == {}


@pytest.mark.parametrize("kind", [PaperAttitude, RotationAttitude])
def test_the_navigator_finds_attitude_bias_and_position(kind):
    system, readings = navigator(kind), flight()
    last, seen = follow(system, navigator_start(system, readings), readings)
    truth = from_euler(jnp.array([0.0, 0.3, 0.7]))
    alignment = np.abs(seen.attitude.x[-40:, :4] @ truth)
    assert 2.0 * np.arccos(np.minimum(alignment, 1.0)).max() < np.radians(1.5)
    np.testing.assert_allclose(seen.attitude.x[-1, 4:], BIAS, atol=0.005)
    # dead reckoning after 40 s, from fixes that differ by 0.05 m
    ahead = 15.0 * 40.0 * np.array([np.cos(0.3) * np.cos(0.7), np.cos(0.3) * np.sin(0.7), -np.sin(0.3)])
    np.testing.assert_allclose(last.position.filter.x, ahead, atol=1.5)


@pytest.mark.long
def test_the_navigator_in_flight_and_off_line_says_the_same():
    system, readings = navigator(), flight()
    state = navigator_start(system, readings)
    last, estimates = follow(system, state, readings)
    program = ahead_of_time(system, state, at(readings, 0))
    packed = program.pack(state)
    for k in range(160):
        packed, estimate = program.step(packed, at(readings, k))
        same(estimate, at(estimates, k), rtol=1e-12, atol=1e-12)
    same(program.unpack(packed), last, rtol=1e-12, atol=1e-12)


@pytest.mark.long
def test_the_navigator_in_float32_stays_so():
    system, readings = navigator(dtype=jnp.float32), flight(dtype=jnp.float32)
    state, seen = follow(system, navigator_start(system, readings), readings)
    leaves = jax.tree.leaves((state, seen))
    assert {leaf.dtype for leaf in leaves if jnp.issubdtype(leaf.dtype, jnp.floating)} == {jnp.dtype(jnp.float32)}
    double, wide = navigator(), flight()
    _, expected = follow(double, navigator_start(double, wide), wide)
    same(seen.attitude.x, expected.attitude.x, atol=2e-4)
    same(seen.position.x, expected.position.x, atol=2e-2)


def spoilt(seed):
    """A flight of 300 readings with everything wrong that the issue names, in random combination, and a start."""
    rng = np.random.default_rng(seed)
    tumble = rng.choice([0.0, 0.8, 2.0]) * np.array([0.1, 1.0, 0.05])
    clean = flight(300, seed, rate=tumble)
    time, gyro, accelerometer, speed, fix, present = (np.array(leaf) for leaf in jax.tree.leaves(clean))
    some = lambda chance: rng.random(300) < chance * (rng.random() < 0.7)
    gyro[some(0.05)] = rng.choice([-1.0, 1.0], 3) * STOP
    present[100:220] &= rng.random() < 0.5
    time += np.where(np.arange(300) >= 250, rng.choice([0.0, 180.0]), 0.0)
    duplicate = np.flatnonzero(some(0.1)[1:]) + 1
    time[duplicate] = time[duplicate - 1]
    present[duplicate] |= rng.random(len(duplicate)) < 0.5
    time[some(0.05)] -= rng.uniform(0.0, 5.0)
    if rng.random() < 0.3:
        time[200:] -= 1000.0
    for values in (gyro, accelerometer, fix, speed, time):
        values[some(0.05)] = rng.choice([np.nan, np.inf, -np.inf])
    broken = FlightReading(*map(jnp.asarray, (time, gyro, accelerometer, speed, fix, present)))
    return broken, rng.choice([0.0, 1.0])


def faults_by_hand(readings, patience=10):
    """What a stream has to count, reading by reading: of the attitude's stream and of the position's."""
    now, behind, taken = None, 0, False
    names = ("untimed", "behind", "restarts", "duplicates", "gaps", "inputs", "saturated", "outputs", "repeated")
    attitude, position = dict.fromkeys(names, 0), dict.fromkeys(names, 0)
    parts = readings.time, readings.gyro, readings.speed, readings.fix, readings.present
    for t, gyro, speed, fix, there in zip(*map(np.asarray, parts), strict=True):
        found, duplicate = None, False
        if not np.isfinite(t):
            found = "untimed"
        elif now is not None and t < now:
            found = "behind" if behind < patience else "restarts"
        elif now is not None and t == now:
            found, duplicate = "duplicates", True
        elif now is not None and t - now > 1.0:
            found = "gaps"
        if found:
            attitude[found] += 1
            position[found] += 1
        if found in ("untimed", "behind"):
            behind += found == "behind"
            continue
        now, behind, taken = t, 0, taken and duplicate
        attitude["inputs"] += not np.isfinite(gyro).all()
        attitude["saturated"] += bool((np.isfinite(gyro) & (np.abs(gyro) >= STOP)).any())
        position["inputs"] += not np.isfinite(speed)
        sound = np.isfinite(fix)
        position["outputs"] += int(there) * int((~sound).sum())
        position["repeated"] += int(there and taken) * 3
        # the tests' fixes are finite in all channels or in none
        taken = taken or bool(there and sound.all())
    return ({name: count for name, count in part.items() if count} for part in (attitude, position))


@pytest.mark.parametrize("kind", [pytest.param(PaperAttitude, marks=pytest.mark.long), RotationAttitude])
def test_nothing_makes_the_navigator_other_than_finite_and_every_fault_is_counted(kind):
    """Quaternions of no length, tumbling, time back, twice and gone, minutes without a fix, stops, no numbers."""
    flights = [spoilt(seed) for seed in range(40)]
    system = navigator(kind, fuzzy=True)
    lengths = jnp.asarray([length for _, length in flights])
    readings = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(readings for readings, _ in flights))

    def fly(readings, length):
        x = jnp.zeros(7).at[0].set(length)
        return follow(system, navigator_start(system, readings, x), readings)

    last, seen = jax.jit(jax.vmap(fly))(readings, lengths)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((last, seen)))
    assert not seen.attitude.diverged.any()
    assert not seen.position.diverged.any()
    np.testing.assert_allclose(np.linalg.norm(seen.attitude.x[..., :4], axis=-1), 1.0, atol=1e-12)
    assert (np.linalg.norm(seen.attitude.x_std, axis=-1) > 0.0).all()
    everything = set()
    for number, (flown, _) in enumerate(flights):
        attitude, position = faults_by_hand(flown)
        # what the gates make of such readings is for tests of gates
        gated = {"rejected", "recoveries"}
        for stream, by_hand in ((last.attitude, attitude), (last.position, position)):
            found = counted(at(stream.faults, number))
            assert {name: found[name] for name in found.keys() - gated} == by_hand
        everything |= set(attitude) | set(position)
    assert len(everything) == 9
