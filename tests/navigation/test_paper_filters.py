"""Attitude and position filters are the paper's equations 3 to 16, written out in NumPy, and singular cases pass."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsub.filter import (
    AbstractForm,
    ConstantNoise,
    Covariance,
    ExtendedKalmanFilter,
    FuzzyNoise,
    RandomNoise,
    Sample,
    SquareRoot,
)
from jaxsub.navigation.attitude import AbstractAttitude, Gyro, PaperAttitude, RotationAttitude
from jaxsub.navigation.position import Course, DeadReckoning

EMPTY = jnp.zeros(0), jnp.zeros((0, 0))
ANGLE_STD = np.radians([1.0, 1.5, 2.0])
BIAS = np.radians([2.0, -1.0, 1.5])
# where both attitudes would say the same, the second is asked when run long
ATTITUDES = [(PaperAttitude(), 7), pytest.param(RotationAttitude(), 6, marks=pytest.mark.long)]


def omega(w):
    """Equation 17."""
    x, y, z = w
    return np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]])


def xi(q):
    """Ω(ω) q as a matrix times ω."""
    return np.stack([omega(axis) @ q for axis in np.eye(3)], axis=1)


def textbook_euler(q):
    """Roll, pitch and yaw of a unit quaternion, as in every textbook, and their derivatives by its four numbers."""
    w, x, y, z = q
    tops = np.array([2 * (w * x + y * z), 2 * (w * z + x * y)])
    beneath = np.array([1 - 2 * (x * x + y * y), 1 - 2 * (y * y + z * z)])
    d_tops = 2 * np.array([[x, w, z, y], [z, y, x, w]])
    d_beneath = -4 * np.array([[0, x, y, 0], [0, 0, y, z]])
    turns = np.arctan2(tops, beneath)
    d_turns = (d_tops * beneath[:, None] - d_beneath * tops[:, None]) / (tops**2 + beneath**2)[:, None]
    sine = 2 * (w * y - x * z)
    d_pitch = 2 * np.array([y, -z, w, -x]) / np.sqrt(1 - sine**2)
    return np.array([turns[0], np.arcsin(sine), turns[1]]), np.stack([d_turns[0], d_pitch, d_turns[1]])


def wrap(angles):
    return np.angle(np.exp(1j * np.asarray(angles)))


def paper_predict(q, bias, P, rate, T, Q):
    """Equations 3 to 6, with the ½; Q a density."""
    A = np.zeros((7, 7))
    A[:4, :4], A[:4, 4:] = 0.5 * omega(rate - bias), -0.5 * xi(q)
    raw = q + T * 0.5 * omega(rate - bias) @ q
    return raw / np.linalg.norm(raw), P + T * (A @ P + P @ A.T + Q)


def exact_predict(q, bias, P, rate, T, Q):
    """Equations 3 to 5, and P by the Jacobian of all three, unit length included."""
    sphere = np.eye(4) - np.outer(q, q)
    turn = np.eye(4) + T * 0.5 * omega(rate - bias)
    raw = turn @ q
    length = np.linalg.norm(raw)
    onto = (np.eye(4) - np.outer(raw, raw) / length**2) / length
    F = np.eye(7)
    F[:4, :4], F[:4, 4:] = onto @ turn @ sphere, -0.5 * T * onto @ xi(q)
    return raw / length, F @ P @ F.T + T * Q


def paper_correct(q, bias, P, angles, R):
    """Equations 7 to 10; Euler(q) is the same for every length of q, hence the projection."""
    expected, C = textbook_euler(q)
    C = np.concatenate([C @ (np.eye(4) - np.outer(q, q)), np.zeros((3, 3))], axis=1)
    K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    x = np.concatenate([q, bias]) + K @ wrap(angles - expected)
    return x[:4] / np.linalg.norm(x[:4]), x[4:], (np.eye(7) - K @ C) @ P


def flight(samples, T, seed=0, every=4):
    """What gyros of a constant bias show on a winding flight, its attitudes, and noisy angles each few samples."""
    rng = np.random.default_rng(seed)
    t = T * np.arange(1, samples + 1)
    rate = np.stack([0.4 * np.sin(0.9 * t), 0.3 * np.cos(0.6 * t), 0.3 + 0.2 * np.sin(0.25 * t)], axis=1)
    attitude, truth = Rotation.from_euler("ZYX", [2.9, 0.1, 0.2]), []
    for w in rate:
        attitude = attitude * Rotation.from_rotvec(w * T)
        truth.append(attitude.as_euler("ZYX")[::-1])
    truth = np.array(truth)
    angles = wrap(truth + ANGLE_STD * rng.normal(size=truth.shape))
    return rate + BIAS, truth, angles, (np.arange(1, samples + 1) % every == 0)


def samples_of(rate, angles, measured, T, dtype=None):
    mask = jnp.broadcast_to(jnp.asarray(measured)[:, None], angles.shape)
    elapsed = jnp.broadcast_to(jnp.asarray(T, dtype), len(angles))
    return Sample(Gyro(jnp.asarray(rate, dtype)), elapsed, jnp.asarray(angles, dtype), mask)


DENSITIES = {ways: np.array([5e-3] * (ways - 3) + [2e-3] * 3) for ways in (6, 7)}


def paper_filter(noise=None, form: AbstractForm = SquareRoot(), process: AbstractAttitude = PaperAttitude(), ways=7):
    roots = {7: [0.2] * 4 + [0.1] * 3, 6: [0.4] * 3 + [0.1] * 3}[ways]
    noise = noise or ConstantNoise(jnp.diag(jnp.asarray(DENSITIES[ways])))
    return ExtendedKalmanFilter(process, noise, jnp.diag(jnp.asarray(ANGLE_STD)), jnp.diag(jnp.array(roots)), form)


@jax.jit
def _scan(filter, state, samples):
    """The joint uncertainty after each sample beside what is known."""

    def one(state, sample):
        state, estimate = filter.step(state, sample)
        return state, (estimate, state.joint)

    return jax.lax.scan(one, state, samples)


def follow(filter, x, samples):
    return _scan(filter, filter.start(jnp.asarray(x), *EMPTY), samples)


START = np.array([np.cos(1.4), 0.0, 0.0, np.sin(1.4), 0.0, 0.0, 0.0])


def test_the_attitude_filter_is_the_papers():
    rate, _, angles, measured = flight(200, 0.25)
    filter = paper_filter()
    _, (seen, joints) = follow(filter, START, samples_of(rate, angles, measured, 0.25))
    q, bias, P = START[:4], np.zeros(3), np.diag(np.diag(filter.x_root) ** 2)
    Q, R = np.diag(DENSITIES[len(filter.x_root)] ** 2), np.diag(ANGLE_STD**2)
    for k in range(200):
        q, P = exact_predict(q, bias, P, rate[k], 0.25, Q)
        if measured[k]:
            q, bias, P = paper_correct(q, bias, P, angles[k], R)
        np.testing.assert_allclose(seen.x[k], np.concatenate([q, bias]), rtol=0, atol=1e-11)
        np.testing.assert_allclose(joints[k] @ joints[k].T, P, rtol=0, atol=1e-12)
    # the heading went through ±180°, and no angle came to be wrong by a turn
    assert np.ptp(np.sign(angles[:, 2])) == 2.0
    assert np.abs(seen.innovation).max() < 0.6


def test_equation_6_is_the_first_order_of_what_the_filter_does():
    """Its error in one step falls with the square of T, apart from the direction along q, which no attitude has."""
    rate, bias = np.array([0.5, -0.4, 0.3]), np.array([0.02, 0.01, -0.03])
    q = np.array([0.5, -0.3, 0.7, 0.4]) / np.sqrt(0.99)
    root = 0.1 * np.random.default_rng(1).normal(size=(7, 7))
    filter = paper_filter()
    filter = ExtendedKalmanFilter(filter.process, filter.noise, filter.R_root, jnp.asarray(root))
    Q = np.diag(DENSITIES[len(filter.x_root)] ** 2)
    periods, errors = 0.2 / 2.0 ** np.arange(7), []
    for T in periods:
        samples = samples_of(rate[None], np.zeros((1, 3)), [False], T)
        state, (seen, _) = follow(filter, np.concatenate([q, bias]), samples)
        after, P = paper_predict(q, bias, root @ root.T, rate, T, Q)
        np.testing.assert_allclose(seen.x[0, :4], after, atol=1e-14)
        sphere = np.eye(7)
        sphere[:4, :4] -= np.outer(after, after)
        errors.append(np.abs(sphere @ (state.joint @ state.joint.T - P) @ sphere).max())
    slopes = np.diff(np.log(errors)) / np.diff(np.log(periods))
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)
    np.testing.assert_allclose(slopes[-1], 2.0, atol=0.005)


RULES = {
    "constant": ConstantNoise(1e-3 * jnp.eye(7)),
    "random": RandomNoise(jnp.full(7, 5e-3), jax.random.key_data(jax.random.key(2))),
    "fuzzy": FuzzyNoise(jnp.full(7, 1e-4), jnp.full(7, 0.1)),
}


@pytest.mark.parametrize(
    ("rule", "form"),
    [("constant", SquareRoot("svd")), ("random", SquareRoot()), ("fuzzy", SquareRoot()), ("fuzzy", Covariance())],
    ids=["constant-svd", "random-qr", "fuzzy-qr", "fuzzy-plain"],
)
def test_noise_in_every_direction_keeps_the_covariance_positive_definite(rule, form):
    rate, truth, angles, measured = flight(200, 0.25)
    filter = paper_filter(RULES[rule], form)
    _, (seen, joints) = follow(filter, START, samples_of(rate, angles, measured, 0.25))
    least = np.linalg.eigvalsh(jax.vmap(form.covariance)(joints))[:, 0]
    assert least.min() > 1e-10
    assert not seen.diverged.any()
    found = Rotation.from_quat(np.roll(seen.x[100:, :4], -1, axis=1))
    error = (Rotation.from_euler("ZYX", truth[100:, ::-1]).inv() * found).magnitude()
    assert np.sqrt(np.mean(error**2)) < np.radians(6.0)


@pytest.mark.parametrize(("process", "ways"), ATTITUDES)
def test_the_gyros_bias_is_found(process, ways):
    rate, _, angles, measured = flight(1600, 0.05, every=20)
    noise = ConstantNoise(jnp.diag(jnp.array([3e-3] * (ways - 3) + [1e-5] * 3)))
    filter = paper_filter(noise, process=process, ways=ways)
    _, (seen, _) = follow(filter, START, samples_of(rate, angles, measured, 0.05))
    # the first-order step turns by the tangent of an angle instead of the angle: (ω T)² / 12, here below 1e-4
    error, std = np.abs(seen.x[-1, 4:] - BIAS), seen.x_std[-1, -3:]
    assert np.linalg.norm(BIAS) > 10.0 * np.linalg.norm(error)
    assert (error < 3.0 * std).all()
    assert (std < np.radians(0.3)).all()


@pytest.mark.parametrize(("process", "ways"), ATTITUDES)
def test_three_time_updates_then_one_measurement_are_three_and_one(process, ways):
    """A measurement at the fourth step, after no more time, is that of a sample which has both."""
    rate, _, angles, measured = flight(30, 1 / 3, every=3)
    filter = paper_filter(process=process, ways=ways)
    whole, _ = follow(filter, START, samples_of(rate, angles, measured, 1 / 3))
    third = np.arange(2, 30, 3)
    insert = lambda values: np.insert(values, third + 1, values[third], axis=0)
    schedule = np.tile([False, False, False, True], 10)
    split = samples_of(insert(rate), insert(angles), schedule, np.where(schedule, 0.0, 1 / 3))
    apart, _ = follow(filter, START, split)
    np.testing.assert_allclose(apart.x, whole.x, rtol=0, atol=1e-13)
    np.testing.assert_allclose(apart.joint @ apart.joint.T, whole.joint @ whole.joint.T, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("process", "ways"), [(PaperAttitude(), 7), (RotationAttitude(), 6)])
def test_passes_through_gimbal_lock_are_finite_and_end_where_they_should(process, ways):
    """Loops in pitch, exactly through ±90° and measured there too, where roll and yaw leap by half a turn.

    Their differences may then be that of a half turn between attitudes that are one, and the filters stray by degrees.
    """
    T, turn, count = 0.05, np.pi / 2, 200
    rate = np.tile([0.0, turn, 0.0], (count, 1))
    pitches = turn * T * np.arange(1, count + 1)
    truth = Rotation.from_rotvec(np.outer(pitches, [0.0, 1.0, 0.0]))
    over = np.where(np.cos(pitches) < 0.0, np.pi, 0.0)
    angles = np.stack([over, np.arcsin(np.sin(pitches)), over], axis=1)
    filter = paper_filter(process=process, ways=ways)
    level = np.array([1.0, 0, 0, 0, 0, 0, 0])
    state, (seen, joints) = follow(filter, level, samples_of(rate, angles, np.ones(count, bool), T))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((seen, joints, state)))
    assert not seen.diverged.any()
    error = (truth.inv() * Rotation.from_quat(np.roll(seen.x[:, :4], -1, axis=1))).magnitude()
    assert error[-1] < np.radians(0.5)


@pytest.mark.parametrize(("process", "ways"), [(PaperAttitude(), 7), (RotationAttitude(), 6)])
def test_a_quaternion_of_no_length_is_the_identity_as_uncertain_as_any(process, ways):
    rate, _, angles, measured = flight(200, 0.25)
    filter, samples = paper_filter(process=process, ways=ways), samples_of(rate, angles, measured, 0.25)
    (nothing, _), (level, _) = (follow(filter, np.array([w, 0, 0, 0, 0, 0, 0.0]), samples) for w in (0.0, 1.0))
    assert not bool(nothing.diverged)
    np.testing.assert_allclose(nothing.x, level.x, rtol=0, atol=1e-14)
    np.testing.assert_allclose(nothing.joint, level.joint, rtol=0, atol=1e-14)


def skew(v):
    return np.cross(np.eye(3), v)


def multiplicative(q, bias, P, rate, T, Q):
    """The step of a rotation's error in body axes, with the right Jacobian of a rotation by a vector."""
    vector = (rate - bias) * T
    angle, K = np.linalg.norm(vector), -skew(vector)
    K = np.array([[0, -vector[2], vector[1]], [vector[2], 0, -vector[0]], [-vector[1], vector[0], 0]])
    right = np.eye(3) - (1 - np.cos(angle)) / angle**2 * K + (angle - np.sin(angle)) / angle**3 * K @ K
    F = np.eye(6)
    F[:3, :3], F[:3, 3:] = Rotation.from_rotvec(vector).as_matrix().T, -T * right
    return q * Rotation.from_rotvec(vector), F @ P @ F.T + T * Q


def euler_rates(angles):
    """The derivatives of roll, pitch and yaw by a rotation about the body's axes."""
    (sp, cp), t, c = (np.sin(angles[0]), np.cos(angles[0])), np.tan(angles[1]), np.cos(angles[1])
    return np.array([[1, sp * t, cp * t], [0, cp, -sp], [0, sp / c, cp / c]])


def test_the_rotation_filter_is_the_multiplicative_one_of_the_textbooks():
    rate, _, angles, measured = flight(200, 0.25)
    filter = paper_filter(process=RotationAttitude(), ways=6)
    _, (seen, joints) = follow(filter, START, samples_of(rate, angles, measured, 0.25))
    q, bias, P = Rotation.from_quat(np.roll(START[:4], -1)), np.zeros(3), np.diag(np.diag(filter.x_root) ** 2)
    Q, R = np.diag(DENSITIES[len(filter.x_root)] ** 2), np.diag(ANGLE_STD**2)
    for k in range(200):
        q, P = multiplicative(q, bias, P, rate[k], 0.25, Q)
        if measured[k]:
            expected = q.as_euler("ZYX")[::-1]
            C = np.concatenate([euler_rates(expected), np.zeros((3, 3))], axis=1)
            K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
            change = K @ wrap(angles[k] - expected)
            q, bias, P = q * Rotation.from_rotvec(change[:3]), bias + change[3:], (np.eye(6) - K @ C) @ P
        found = Rotation.from_quat(np.roll(seen.x[k, :4], -1))
        assert (q.inv() * found).magnitude() < 1e-11
        np.testing.assert_allclose(seen.x[k, 4:], bias, rtol=0, atol=1e-11)
        np.testing.assert_allclose(joints[k] @ joints[k].T, P, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", [PaperAttitude, RotationAttitude])
def test_a_gyro_at_its_stop_leaves_what_it_may_have_missed_unknown(kind):
    ways = 7 if kind is PaperAttitude else 6
    filter = paper_filter(process=kind(gyro_range=2.0), ways=ways)
    rate = np.array([[0.1, 2.0, -0.2]])
    state, _ = follow(filter, START, samples_of(rate, np.zeros((1, 3)), [False], 0.1))
    free, _ = follow(paper_filter(process=kind(), ways=ways), START, samples_of(rate, np.zeros((1, 3)), [False], 0.1))
    more = np.asarray(state.joint @ state.joint.T - free.joint @ free.joint.T)
    # 0.2 rad about the body's y axis before the step, and nothing else
    way = np.eye(6)[1] if ways == 6 else np.pad(0.5 * xi(START[:4])[:, 1], (0, 3))
    np.testing.assert_allclose(more, 0.2**2 * np.outer(way, way), rtol=0, atol=1e-15)


def test_the_position_filter_is_the_papers():
    rng = np.random.default_rng(5)
    speeds, stds = rng.uniform(10, 20, 40), rng.uniform(0.01, 0.1, (40, 3))
    attitudes = Rotation.from_rotvec(rng.normal(size=(40, 3)))
    fixes, measured = rng.normal(0, 30, (40, 3)), np.arange(40) % 4 == 3
    density, R_root = np.diag([0.3, 0.4, 0.5]), np.linalg.cholesky([[9.0, 1, 0], [1, 4, 1], [0, 1, 25]])
    process = DeadReckoning(speed_std=0.8, correlation=0.7)
    noise = ConstantNoise(jnp.asarray(density))
    filter = ExtendedKalmanFilter(process, noise, jnp.asarray(R_root), 10.0 * jnp.eye(3))
    quaternions = np.roll(attitudes.as_quat(), 1, axis=1)
    course = Course(jnp.asarray(speeds), jnp.asarray(quaternions), jnp.asarray(stds))
    mask = jnp.broadcast_to(jnp.asarray(measured)[:, None], (40, 3))
    _, (seen, joints) = follow(filter, np.zeros(3), Sample(course, jnp.full(40, 0.25), jnp.asarray(fixes), mask))
    p, P, R = np.zeros(3), 100.0 * np.eye(3), R_root @ R_root.T
    for k, (speed, turn) in enumerate(zip(speeds, attitudes.as_matrix(), strict=True)):
        ahead = np.array([speed, 0, 0])
        G = np.concatenate([turn[:, :1], turn @ np.cross(np.eye(3), ahead).T], axis=1)
        Qu = 2 * 0.7 * np.diag(np.concatenate([[0.8], stds[k]]) ** 2)
        p, P = p + 0.25 * turn @ ahead, P + 0.25 * (density**2 + G @ Qu @ G.T)
        if measured[k]:
            K = P @ np.linalg.inv(P + R)
            p, P = p + K @ (fixes[k] - p), (np.eye(3) - K) @ P
        np.testing.assert_allclose(seen.x[k], p, rtol=0, atol=1e-10)
        np.testing.assert_allclose(joints[k] @ joints[k].T, P, rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize(("process", "ways"), ATTITUDES)
def test_float32_stays_float32_and_close(process, ways):
    rate, _, angles, measured = flight(200, 0.05)
    filter = paper_filter(process=process, ways=ways)
    narrow = lambda leaf: leaf.astype(jnp.float32) if isinstance(leaf, jax.Array) else leaf
    single = jax.tree.map(narrow, filter)
    low = single.start(jnp.asarray(START, jnp.float32), jnp.zeros(0, jnp.float32), jnp.zeros((0, 0), jnp.float32))
    low, (_, joints) = _scan(single, low, samples_of(rate, angles, measured, 0.05, jnp.float32))
    high, _ = follow(filter, START, samples_of(rate, angles, measured, 0.05))
    assert low.x.dtype == low.joint.dtype == joints.dtype == jnp.float32
    np.testing.assert_allclose(low.x, high.x, rtol=0, atol=2e-5)
    np.testing.assert_allclose(np.abs(low.joint), np.abs(high.joint), rtol=0, atol=1e-5)
