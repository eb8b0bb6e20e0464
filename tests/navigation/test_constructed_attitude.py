"""Fixes and accelerometers of a steady manoeuvre give its attitude exactly, and where they cannot, say so."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from jaxsub.navigation.constructed import (
    ConstructedAttitudeStream,
    Limits,
    constructed_attitude,
    constructed_over,
    standard_deviations,
)

G = 9.80665
ANYTHING = np.pi / np.sqrt(3.0)
TIMES = np.array([10.0, 11.0, 12.0])

constructed = jax.jit(lambda fixes, times, f: constructed_attitude(fixes, times, f))
with_heading = jax.jit(lambda fixes, times, f, heading: constructed_attitude(fixes, times, f, heading))
deviations = jax.jit(lambda fixes, times, f, *stds: standard_deviations(fixes, times, f, *stds))
deviations_with_heading = jax.jit(
    lambda fixes, times, f, xyz, acc, heading, std: standard_deviations(fixes, times, f, xyz, acc, heading, std)
)


def level_specific_force(angles, acceleration):
    return Rotation.from_euler("ZYX", angles[::-1]).inv().apply(np.asarray(acceleration) - [0.0, 0.0, G])


def window(angles, acceleration, times=TIMES, speed=15.0, climb=0.0, course=None):
    """Fixes of a vehicle that accelerates evenly, and heads along its track at the mean of the two velocities."""
    acceleration = np.asarray(acceleration, float)
    course = angles[2] if course is None else course
    since = (times - (times[0] + 2 * times[1] + times[2]) / 4.0)[:, None]
    velocity = np.array([speed * np.cos(course), speed * np.sin(course), climb])
    fixes = np.array([300.0, -40.0, 12.0]) + velocity * since + 0.5 * acceleration * since**2
    return fixes, times, level_specific_force(angles, acceleration)


def apart(found, expected):
    return np.abs(np.angle(np.exp(1j * (np.asarray(found) - np.asarray(expected)))))


def turned(angles, acceleration):
    """The specific force that the vehicle would show if its roll were zero, and were its pitch too."""
    h = Rotation.from_euler("z", angles[2]).inv().apply(np.asarray(acceleration) - [0.0, 0.0, G])
    return Rotation.from_euler("y", angles[1]).inv().apply(h), h


angle = st.floats(-np.pi, np.pi)
motions = st.tuples(
    st.tuples(angle, st.floats(-1.5, 1.5), angle), st.tuples(*[st.floats(-4.0, 4.0)] * 3), st.floats(0.3, 2.5)
)


@given(motions)
@settings(max_examples=300, deadline=None)
def test_steady_manoeuvres_are_recovered_exactly(motion):
    angles, acceleration, second = motion
    without_roll, _ = turned(angles, acceleration)
    # on this side of the apparent horizon, and not so near it that rounding is magnified
    assume(without_roll[2] < -0.5 and np.hypot(*without_roll[1:]) > 1.01)
    found = constructed(*window(angles, acceleration, np.array([10.0, 11.0, 11.0 + second])))
    assert found.known.all()
    assert apart(found.angles, angles).max() < 1e-10
    assert float(found.delay) == pytest.approx((1.0 + second) / 2.0)


@given(motions, st.floats(10.0, 30.0))
@settings(max_examples=100, deadline=None)
def test_falling_faster_than_gravity_pulls_takes_the_other_branch(motion, fall):
    angles, acceleration, _ = motion
    acceleration = (*acceleration[:2], G + fall)
    without_roll, _ = turned(angles, acceleration)
    assume(without_roll[2] > 0.5 and np.hypot(*without_roll[1:]) > 1.01)
    found = constructed(*window(angles, acceleration))
    assert found.known.all()
    assert apart(found.angles, angles).max() < 1e-10


@given(motions)
@settings(max_examples=200, deadline=None)
def test_whatever_is_known_explains_the_reading(motion):
    angles, acceleration, _ = motion
    fixes, times, f = window(angles, acceleration)
    found = constructed(fixes, times, f)
    assert np.isfinite(found.angles).all() and abs(float(found.angles[1])) <= np.pi / 2
    if found.known.all():
        np.testing.assert_allclose(level_specific_force(np.asarray(found.angles), acceleration), f, atol=1e-6)


def test_beyond_the_apparent_upright_the_mirrored_pitch_is_found():
    """The documented ambiguity: 80° nose up, accelerating ahead at half of gravity."""
    angles, ahead = np.array([0.2, np.deg2rad(80.0), 0.0]), np.array([G / 2, 0.0, 0.0])
    fixes, times, f = window(angles, ahead)
    found = constructed(fixes, times, f)
    assert abs(float(found.angles[1])) < angles[1]
    np.testing.assert_allclose(level_specific_force(np.asarray(found.angles), ahead), f, atol=1e-10)


def test_a_slow_vehicle_has_a_level_but_no_heading():
    angles = np.array([0.3, -0.5, 2.0])
    fixes, times, f = window(angles, np.zeros(3), speed=0.9)
    found = constructed(fixes, times, f)
    np.testing.assert_array_equal(found.known, [True, True, False])
    assert apart(found.angles[:2], angles[:2]).max() < 1e-12
    given_heading = with_heading(fixes, times, f, 2.0)
    assert given_heading.known.all() and apart(given_heading.angles, angles).max() < 1e-12


def test_a_slow_vehicle_that_accelerates_needs_a_heading():
    angles, ahead = np.array([0.3, -0.5, 2.0]), np.array([-1.0, 2.0, 0.0])
    fixes, times, f = window(angles, ahead, speed=0.5)
    assert not constructed(fixes, times, f).known.any()
    found = with_heading(fixes, times, f, 2.0 + 2 * np.pi)
    assert found.known.all() and apart(found.angles, angles).max() < 1e-12


def test_a_given_heading_replaces_the_track_and_one_that_is_not_finite_does_not():
    """A vehicle that slips sideways by 0.4 rad in a turn."""
    angles, inward = np.array([0.5, 0.1, 1.0]), np.array([-3.0, 1.0, 0.0])
    fixes, times, f = window(angles, inward, course=1.4)
    assert apart(constructed(fixes, times, f).angles, angles).max() > 0.1
    assert apart(with_heading(fixes, times, f, 1.0).angles, angles).max() < 1e-12
    np.testing.assert_allclose(with_heading(fixes, times, f, np.nan).angles, constructed(fixes, times, f).angles)


def test_free_fall_has_a_track_only():
    falling = np.array([0.0, 0.0, G])
    found = constructed(*window(np.array([0.3, -0.5, 2.0]), falling))
    np.testing.assert_array_equal(found.known, [False, False, True])
    assert np.isfinite(found.angles).all()
    assert apart(found.angles[2], 2.0) < 1e-12


@pytest.mark.parametrize("force", [-1.01 * G, 1.01 * G, -1e300])
def test_more_force_ahead_than_there_is_in_all_is_clipped_and_flagged(force):
    fixes, times, _ = window(np.zeros(3), np.zeros(3))
    found = constructed(fixes, times, np.array([force, 0.0, 0.0]))
    np.testing.assert_array_equal(found.known, [False, False, True])
    assert float(found.angles[1]) == pytest.approx(np.sign(force) * np.pi / 2)


@pytest.mark.parametrize("pitch", [-np.pi / 2, np.pi / 2])
def test_hanging_from_the_nose_or_tail_has_no_roll(pitch):
    near = np.array([0.4, pitch * (1 - 1e-6), 1.0])
    found = constructed(*window(near, np.zeros(3)))
    np.testing.assert_array_equal(found.known, [False, True, True])
    # the arccosine has half of the digits
    assert apart(found.angles[1:], near[1:]).max() < 1e-9
    exact = constructed(*window(np.array([0.4, pitch, 1.0]), np.zeros(3)))
    assert not exact.known[0] and float(exact.angles[1]) == pytest.approx(pitch, abs=1e-7)


def test_no_pitch_within_a_right_angle_is_flagged():
    """On its back and accelerating against its heading: the track and the reading contradict each other."""
    backwards = level_specific_force(np.array([0.0, -2.0, 0.0]), np.array([8.0, 0.0, 0.0]))
    fixes, times, _ = window(np.zeros(3), np.array([8.0, 0.0, 0.0]))
    found = constructed(fixes, times, backwards)
    np.testing.assert_array_equal(found.known, [False, False, True])
    assert abs(float(found.angles[1])) <= np.pi / 2


@pytest.mark.parametrize(
    "times", [[10.0, 10.0, 12.0], [10.0, 12.0, 11.0], [12.0, 11.0, 10.0], [10.0, 11.0, 99.0], [10.0, np.nan, 12.0]]
)
def test_times_that_do_not_increase_or_span_too_long_give_nothing(times):
    fixes, _, f = window(np.array([0.1, 0.2, 0.3]), np.ones(3))
    found = constructed(fixes, np.array(times), f)
    assert not found.known.any() and np.isfinite(found.angles).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1.7e308])
@pytest.mark.parametrize("part", [0, 2])
def test_numbers_that_cannot_be_used_give_no_nan(bad, part):
    parts = [np.array(p) for p in window(np.array([0.1, 0.2, 0.3]), np.ones(3))]
    parts[part].flat[1] = bad
    if part == 0:
        parts[0].flat[4] = -bad
    found = constructed(*parts)
    assert np.isfinite(found.angles).all()
    if part == 0 or not np.isfinite(bad):
        assert not found.known.any()
    stds = deviations(*parts, np.ones(3), np.ones(3))
    assert np.isfinite(stds).all() and np.all(stds <= ANYTHING)


@pytest.mark.parametrize(
    "angles, acceleration, speed",
    [([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 15.0), ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], 0.0), ([0.4, np.pi / 2, 1.0],) * 2
     + (15.0,), ([0.3, 0.2, 1.0], [0.0, 0.0, G], 15.0)],
)  # fmt: skip
def test_slopes_are_finite_at_rest_level_upright_and_in_free_fall(angles, acceleration, speed):
    parts = window(np.array(angles), np.array(acceleration), speed=speed)
    slopes = jax.jacrev(lambda *p: constructed_attitude(*p).angles, argnums=(0, 2))(*map(jnp.asarray, parts))
    assert all(np.isfinite(slope).all() for slope in slopes)


@pytest.mark.parametrize("heading", [None, 1.1])
def test_standard_deviations_are_those_of_many_draws(heading):
    rng = np.random.default_rng(8)
    angles, acceleration = np.array([0.5, -0.3, 1.1]), np.array([1.0, -2.0, 0.5])
    fixes, times, f = window(angles, acceleration)
    xyz, acc, heading_std = np.array([0.05, 0.08, 0.1]), np.array([0.02, 0.05, 0.03]), 0.03
    many = 20_000
    noisy = fixes + xyz * rng.normal(size=(many, 3, 3)), f + acc * rng.normal(size=(many, 3))
    if heading is None:
        expected = deviations(fixes, times, f, xyz, acc)
        draws = jax.jit(jax.vmap(lambda p, f: constructed_attitude(p, jnp.asarray(times), f)))(*noisy)
    else:
        expected = deviations_with_heading(fixes, times, f, xyz, acc, heading, heading_std)
        headings = heading + heading_std * rng.normal(size=many)
        draws = jax.jit(jax.vmap(lambda p, f, h: constructed_attitude(p, jnp.asarray(times), f, h)))(*noisy, headings)
    assert draws.known.all()
    np.testing.assert_allclose(expected, np.std(draws.angles, axis=0), rtol=0.03)


def test_what_is_unknown_deviates_as_one_that_may_be_anything():
    stds = deviations(*window(np.array([0.3, -0.5, 2.0]), np.zeros(3), speed=0.1), np.full(3, 0.01), np.full(3, 0.1))
    assert float(stds[2]) == pytest.approx(ANYTHING)
    # at rest the reading alone tells the pitch: f_x = g sin θ
    assert float(stds[1]) == pytest.approx(0.1 / (G * np.cos(0.5)), rel=0.02)
    poor = deviations(*window(np.zeros(3), np.zeros(3)), np.full(3, 1e4), np.full(3, 0.1))
    np.testing.assert_allclose(poor, ANYTHING)


# recordings


def recording(rate=10.0, seconds=8.0, seed=0):
    """A turning, bobbing vehicle with a fix a second, as (times, accelerometer, fixes, present)."""
    rng = np.random.default_rng(seed)
    times = np.arange(int(rate * seconds) + 1) / rate
    readings = np.array([0.0, 0.0, -G]) + rng.normal(size=(len(times), 3))
    fixes = np.stack([12.0 * times, 3.0 * np.sin(times), 0.1 * times], axis=1)
    present = np.arange(len(times)) % int(rate) == 0
    return times, readings, np.where(present[:, None], fixes, np.nan), present


over = jax.jit(lambda *samples: constructed_over(*samples))


@pytest.mark.parametrize("with_course", [False, True])
def test_streaming_is_off_line_bit_for_bit(with_course):
    samples = recording()
    if with_course:
        samples = (*samples, np.linspace(-1.0, 1.0, len(samples[0])))
    whole = over(*map(jnp.asarray, samples))
    step = jax.jit(lambda state, *sample: state.step(*sample))
    state = ConstructedAttitudeStream.start()
    for k, sample in enumerate(zip(*samples, strict=True)):
        state, found = step(state, *sample)
        for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(whole), strict=True):
            np.testing.assert_array_equal(one, other[k])


def test_a_window_is_its_three_fixes_and_the_integral_of_the_reading_between_them():
    times, readings, fixes, present = recording()
    times = times + np.where(present, 0.0, 0.03 * np.sin(40.0 * times))
    found = over(times, readings, fixes, present)
    third = np.flatnonzero(present)[2:]
    np.testing.assert_array_equal(np.flatnonzero(found.known.any(axis=1)), third)
    for end in third:
        part = slice(end - 20, end + 1)
        mean = np.trapezoid(readings[part], times[part], axis=0) / 2.0
        alone = constructed(fixes[end - 20 : end + 1 : 10], times[end - 20 : end + 1 : 10], mean)
        np.testing.assert_allclose(found.window.accelerometer[end], mean, atol=1e-12)
        np.testing.assert_allclose(found.angles[end], alone.angles, atol=1e-12)
    np.testing.assert_allclose(found.delay[third], 1.0, atol=1e-12)


def test_an_outage_gives_nothing_until_three_fixes_have_come_again():
    times, readings, fixes, present = recording(seconds=12.0)
    present = present & ~((times > 3.5) & (times < 7.5))
    found = over(times, readings, fixes, present)
    np.testing.assert_array_equal(np.round(times[found.known.any(axis=1)], 6), [2.0, 3.0, 10.0, 11.0, 12.0])


@pytest.mark.parametrize("fault", ["duplicate", "no time", "no fix", "no reading", "clock set back", "late fix twice"])
def test_faults_of_the_recording_are_passed_over(fault):
    times, readings, fixes, present = (np.array(column) for column in recording())
    sound = over(times, readings, fixes, present)
    expected = np.array(sound.known.any(axis=1))
    at = 45
    if fault == "duplicate":
        times[at] = times[at - 1]
    elif fault == "no time":
        times[at] = np.nan
    elif fault == "no fix":
        fixes[40] = np.nan
        # the windows that would hold it are a second longer
        expected[40] = False
    elif fault == "no reading":
        readings[31:39] = np.nan
    elif fault == "clock set back":
        times[at:] -= 100.0
        expected[[50, 60]] = False
    else:
        fixes[41], present[41], times[41] = fixes[40] + 1.0, True, times[40]
    found = over(times, readings, fixes, present)
    np.testing.assert_array_equal(found.known.any(axis=1), expected)
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(found))
    if fault != "clock set back":
        # the last window is past the fault
        np.testing.assert_allclose(found.angles[-1], sound.angles[-1], atol=1e-9)


def test_an_accelerometer_that_was_hardly_heard_gives_nothing():
    times, readings, fixes, present = recording()
    readings[23:38] = np.nan
    found = over(times, readings, fixes, present)
    # of the window from 2 to 4 s less than half is left
    np.testing.assert_array_equal(np.round(times[found.known.any(axis=1)], 6), [2.0, 3.0, 5.0, 6.0, 7.0, 8.0])


def test_slopes_of_a_recording_with_faults_are_finite():
    times, readings, fixes, present = recording(seconds=4.0)
    times[25] = np.nan
    fixes[27] = np.inf
    total = lambda *samples: jnp.sum(constructed_over(*samples).angles)
    slopes = jax.jit(jax.grad(total, argnums=(1, 2)))(*map(jnp.asarray, (times, readings, fixes, present)))
    assert all(np.isfinite(slope).all() for slope in slopes)
    assert np.any(slopes[0] != 0.0) and np.any(slopes[1] != 0.0)


def test_single_precision_and_limits_are_kept():
    samples = recording()
    single = [np.asarray(column, np.float32) for column in samples[:3]]
    found = over(*single, samples[3])
    assert found.angles.dtype == jnp.float32
    np.testing.assert_allclose(found.angles, over(*samples).angles, atol=2e-4)
    none = constructed_over(*map(jnp.asarray, samples), limits=dataclasses.replace(Limits(), span=1.9))
    assert not none.known.any()
