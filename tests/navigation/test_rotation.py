"""Quaternions agree with SciPy's rotations and stay finite, derivatives too, where their formulas are singular."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from jaxsub.navigation import rotation

rng = np.random.default_rng(5)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
HALF_TURNS = [np.array([0.0, *axis]) for axis in (*np.eye(3), -np.eye(3)[0], np.array([0.6, 0.0, -0.8]))]
steep = st.sampled_from([-np.pi / 2, np.pi / 2])
near_lock = st.builds(lambda pole, offset: pole - np.sign(pole) * offset, steep, st.floats(0.0, 1e-3))
pitches = st.one_of(st.floats(-np.pi / 2, np.pi / 2), near_lock)
turns = st.floats(-np.pi, np.pi)
attitudes = st.builds(lambda *angles: np.array(angles), turns, pitches, turns)
vectors = arrays(float, 3, elements=st.floats(-2.0, 2.0))

euler, from_euler = jax.jit(rotation.euler), jax.jit(rotation.from_euler)
exponential, logarithm = jax.jit(rotation.exponential), jax.jit(rotation.logarithm)
matrix, product, normalised = jax.jit(rotation.matrix), jax.jit(rotation.product), jax.jit(rotation.normalised)
slope_of_exponential, slope_of_euler = jax.jit(jax.jacfwd(rotation.exponential)), jax.jit(jax.jacfwd(rotation.euler))
slope_of_logarithm = jax.jit(jax.jacrev(rotation.logarithm))


def scipys(q):
    return Rotation.from_quat(np.asarray(q), scalar_first=True)


def random_quaternion():
    q = rng.normal(size=4)
    return q / np.linalg.norm(q)


def by_differences(f, x, step=1e-6):
    moves = step * np.eye(len(x))
    return np.stack([(np.asarray(f(x + d)) - np.asarray(f(x - d))) / (2 * step) for d in moves], axis=-1)


def test_matrix_product_and_conjugate_are_scipys():
    q, p, v = random_quaternion(), random_quaternion(), rng.normal(size=3)
    np.testing.assert_allclose(matrix(q) @ v, scipys(q).apply(v), atol=1e-14)
    np.testing.assert_allclose(matrix(product(q, p)), (scipys(q) * scipys(p)).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(product(q, rotation.conjugate(jnp.asarray(q))), IDENTITY, atol=1e-15)


def test_omega_is_eq_17_and_turns_at_half_its_rate():
    p, q, r = w = np.array([0.3, -0.2, 0.7])
    omega = rotation.omega_matrix(jnp.asarray(w))
    np.testing.assert_array_equal(omega, [[0, -p, -q, -r], [p, 0, r, -q], [q, -r, 0, p], [r, q, -p, 0]])
    start = random_quaternion()
    after = scipys(start) * Rotation.from_rotvec(1e-6 * w)
    np.testing.assert_allclose(matrix(normalised(start + 0.5e-6 * omega @ start)), after.as_matrix(), atol=1e-11)


@given(arrays(float, 3, elements=st.floats(-10.0, 10.0)))
@settings(max_examples=200, deadline=None)
def test_exponential_is_scipys_rotation_vector(v):
    q = exponential(v)
    assert abs(float(q @ q) - 1.0) < 1e-14
    np.testing.assert_allclose(matrix(q), Rotation.from_rotvec(v).as_matrix(), atol=1e-14)


@given(vectors, st.sampled_from([1.0, 1e-2, 1e-3, 1e-9, 1e-200]), st.sampled_from([1.0, -1.0]))
@settings(max_examples=200, deadline=None)
def test_logarithm_undoes_the_exponential_of_either_sign(v, size, sign):
    v = v * size * min(1.0, 3.1 / max(np.linalg.norm(v), 1e-300))
    np.testing.assert_allclose(logarithm(sign * exponential(v)), v, rtol=1e-12, atol=1e-15 * size)


@given(attitudes)
@settings(max_examples=300, deadline=None)
def test_angles_make_scipys_rotation_and_come_back_as_the_same_rotation(angles):
    q = from_euler(angles)
    expected = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
    np.testing.assert_allclose(matrix(q), expected, atol=1e-14)
    found = np.asarray(euler(-2.5 * q))
    # an arctangent may be rounded to the number after π
    assert abs(found[1]) <= np.pi / 2 and np.all(np.abs(found) <= np.nextafter(np.pi, 4.0))
    np.testing.assert_allclose(matrix(from_euler(found)), expected, atol=2e-14)
    # an arcsine would lose half of the digits of a steep pitch
    assert abs(found[1] - angles[1]) < 1e-14


@given(attitudes)
@settings(max_examples=100, deadline=None)
def test_angles_away_from_lock_are_scipys(angles):
    q = np.asarray(from_euler(angles * [1.0, 0.98, 1.0]))
    apart = np.asarray(euler(q)) - scipys(q).as_euler("ZYX")[::-1]
    np.testing.assert_allclose(np.sin(apart / 2.0), 0.0, atol=1e-13)


def test_slopes_are_those_of_differences():
    v, q = rng.normal(size=3), random_quaternion()
    for small in (1.0, 1e-3):
        near = slope_of_exponential(small * v)
        np.testing.assert_allclose(near, by_differences(exponential, small * v), atol=1e-9)
        near = slope_of_logarithm(exponential(small * v))
        np.testing.assert_allclose(near, by_differences(logarithm, np.asarray(exponential(small * v))), atol=1e-8)
    np.testing.assert_allclose(slope_of_euler(q), by_differences(euler, q), atol=1e-8)


def test_slopes_at_no_rotation_are_the_closed_forms():
    half = np.vstack([np.zeros(3), 0.5 * np.eye(3)])
    np.testing.assert_allclose(slope_of_exponential(np.zeros(3)), half, atol=1e-16)
    np.testing.assert_allclose(slope_of_logarithm(IDENTITY), 4.0 * half.T, atol=1e-15)
    second = jax.jacfwd(jax.jacrev(lambda v: rotation.exponential(v)[0]))(jnp.zeros(3))
    np.testing.assert_allclose(second, -0.25 * np.eye(3), atol=1e-16)


@pytest.mark.parametrize("q", HALF_TURNS)
def test_half_turns_have_a_vector_and_a_slope(q):
    v = np.asarray(logarithm(q))
    np.testing.assert_allclose(np.linalg.norm(v), np.pi, rtol=1e-15)
    np.testing.assert_allclose(np.cross(v, q[1:]), 0.0, atol=1e-15)
    assert np.isfinite(slope_of_logarithm(q)).all()


@pytest.mark.parametrize("pole", [-1.0, 1.0])
@pytest.mark.parametrize("turn", [0.0, 0.4, -3.0])
def test_gimbal_lock_has_angles_and_slopes(pole, turn):
    exact = np.array([np.cos(turn / 2), -pole * np.sin(turn / 2), pole * np.cos(turn / 2), np.sin(turn / 2)])
    found = np.asarray(euler(exact))
    np.testing.assert_allclose(found, [0.0, pole * np.pi / 2, turn], atol=1e-15)
    # the next double is no longer locked
    for q in (exact, exact + 1e-16, exact + 1e-14):
        assert np.isfinite(euler(q)).all() and np.isfinite(slope_of_euler(q)).all()


@pytest.mark.parametrize("bad", [np.zeros(4), np.full(4, np.nan), np.array([1.0, np.inf, 0.0, 0.0])])
def test_a_quaternion_that_is_none_is_the_identity(bad):
    np.testing.assert_array_equal(normalised(bad), IDENTITY)
    np.testing.assert_array_equal(euler(bad), np.zeros(3))
    np.testing.assert_array_equal(logarithm(bad), np.zeros(3))
    for f in (rotation.normalised, rotation.euler, rotation.logarithm):
        np.testing.assert_array_equal(jax.jacrev(f)(jnp.asarray(bad)), 0.0)


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1.0, 1e160, 1e300])
def test_lengths_whose_squares_are_out_of_range_are_normalised(scale):
    q = random_quaternion()
    np.testing.assert_allclose(normalised(scale * q), q, rtol=1e-14)
    slope = jax.jacfwd(rotation.normalised)(jnp.asarray(scale * q))
    np.testing.assert_allclose(scale * slope, np.eye(4) - np.outer(q, q), atol=1e-14)


def test_batches_in_single_precision_stay_in_it():
    batch = jnp.asarray(rng.normal(size=(50, 4)), jnp.float32)
    angles = jax.vmap(rotation.euler)(batch)
    assert angles.dtype == jnp.float32
    expected = scipys(batch.astype(float)).as_matrix()
    np.testing.assert_allclose(jax.vmap(lambda a: rotation.matrix(rotation.from_euler(a)))(angles), expected, atol=2e-6)


@given(st.floats(-1e3, 1e3))
@settings(max_examples=100, deadline=None)
def test_wrapping_takes_whole_turns_off(angle):
    found = float(rotation.wrapped(jnp.asarray(angle)))
    assert -np.pi < found <= np.pi + 1e-12
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angle), atol=1e-12)
