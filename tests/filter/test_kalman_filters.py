"""The filters are what their papers say, written out in NumPy, on-line as off-line, and failures are values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_cases import Driven, Linear, Spring, alone, at, sequence

from jaxsub.filter.ekf import ExtendedKalmanFilter, on_line
from jaxsub.filter.form import Covariance, SquareRoot
from jaxsub.filter.mekf import ModifiedKalmanFilter
from jaxsub.filter.noise import ConstantNoise
from jaxsub.filter.passes import identify, over_runs

FORMS = [SquareRoot(), SquareRoot("svd"), Covariance()]
BOTH = [ExtendedKalmanFilter, ModifiedKalmanFilter]
R_ROOT = np.linalg.cholesky([[4e-4, 1e-4], [1e-4, 9e-4]])


def kalman(F, C, Q, R, P, x, inputs, outputs, mask):
    """Kalman's filter with covariances, as in every textbook."""
    for u, z, seen in zip(inputs, outputs, mask, strict=True):
        x, P = F @ x + u, F @ P @ F.T + Q
        H, V = C[seen], R[np.ix_(seen, seen)]
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + V)
        x, P = x + K @ (z[seen] - H @ x), (np.eye(len(x)) - K @ H) @ P
    return x, P


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize("form", FORMS, ids=["qr", "svd", "plain"])
def test_a_linear_process_without_parameters_gets_kalmans_filter(kind, form):
    rng = np.random.default_rng(0)
    F, C, G = 0.4 * rng.normal(size=(4, 4)), rng.normal(size=(2, 4)), 0.1 * rng.normal(size=(4, 2))
    inputs, outputs, mask = rng.normal(size=(25, 4)), rng.normal(size=(25, 2)), rng.random((25, 2)) < 0.7
    root = rng.normal(size=(4, 4))
    noise = ConstantNoise(jnp.asarray(G))
    filter = kind(Linear(jnp.asarray(F), jnp.asarray(C)), noise, jnp.asarray(R_ROOT), jnp.asarray(root), form)
    start = filter.start(jnp.ones(4), jnp.zeros(0), jnp.zeros((0, 0)))
    state, estimates = over_runs(filter, start, alone(sequence(inputs, outputs, mask)), jnp.ones((1, 4)))
    x, P = kalman(F, C, G @ G.T, R_ROOT @ R_ROOT.T, root @ root.T, np.ones(4), inputs, outputs, mask)
    np.testing.assert_allclose(state.x, x, rtol=0, atol=1e-10)
    np.testing.assert_allclose(form.covariance(state.joint), P, rtol=0, atol=1e-10)
    np.testing.assert_allclose(estimates.x_std[0, -1], np.sqrt(np.diag(P)), rtol=1e-10)
    np.testing.assert_array_equal(estimates.innovation[0][~mask], 0.0)


def spring_record(samples=80, seed=4):
    """Inputs, outputs with a tenth missing, and the mask, of a spring of stiffness 3 and damping 0.8."""
    rng = np.random.default_rng(seed)
    inputs, x, outputs = rng.choice([-1.0, 1.0], (samples // 8, 1)).repeat(8, 0), np.zeros(2), []
    for u in inputs:
        x = np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * (u[0] - 3.0 * x[0] - 0.8 * x[1])])
        outputs.append([x[0], 2.0 * x[0] + x[1]] + R_ROOT @ rng.normal(size=2))
    return inputs, np.array(outputs), rng.random((samples, 2)) < 0.9


def spring_filter(kind, form=FORMS[0]):
    noise = ConstantNoise(jnp.diag(jnp.array([0.005, 0.01])))
    return kind(Spring(), noise, jnp.asarray(R_ROOT), 0.05 * jnp.eye(2), form)


def chui_and_chen(inputs, outputs, mask, theta):
    """The parallel algorithm: I for x with θ known, II for [x, θ] about x of I and θ; covariances throughout."""
    x, R, Q = np.zeros(2), R_ROOT @ R_ROOT.T, np.diag([0.005**2, 0.01**2])
    P = 0.05**2 * np.eye(2)
    PP = np.diag([0.05**2, 0.05**2, 1.0, 1.0])
    C = np.array([[1.0, 0.0], [2.0, 1.0]])
    for u, z, seen in zip(inputs, outputs, mask, strict=True):
        F = np.array([[1.0, 0.1], [-0.1 * theta[0], 1.0 - 0.1 * theta[1]]])
        by_theta = np.array([[0.0, 0.0], [-0.1 * x[0], -0.1 * x[1]]])
        A = np.block([[F, by_theta], [np.zeros((2, 2)), np.eye(2)]])
        QQ = np.zeros((4, 4))
        QQ[:2, :2] = Q
        x = F @ x + [0.0, 0.1 * u[0]]
        P, PP = F @ P @ F.T + Q, A @ PP @ A.T + QQ
        H, V = C[seen], R[np.ix_(seen, seen)]
        HH = np.concatenate([H, np.zeros((len(H), 2))], 1)
        innovation = z[seen] - H @ x
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + V)
        KK = PP @ HH.T @ np.linalg.inv(HH @ PP @ HH.T + V)
        x, P, PP = x + K @ innovation, (np.eye(2) - K @ H) @ P, (np.eye(4) - KK @ HH) @ PP
        theta = theta + (KK @ innovation)[2:]
    return x, theta, PP


@pytest.mark.parametrize("form", FORMS, ids=["qr", "svd", "plain"])
def test_the_modified_filter_is_the_papers_pair(form):
    inputs, outputs, mask = spring_record()
    x, theta, PP = chui_and_chen(inputs, outputs, mask, np.array([2.0, 0.4]))
    filter = spring_filter(ModifiedKalmanFilter, form)
    start = filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), jnp.eye(2))
    state, _ = over_runs(filter, start, alone(sequence(inputs, outputs, mask)), jnp.zeros((1, 2)))
    np.testing.assert_allclose(state.x, x, rtol=1e-8)
    np.testing.assert_allclose(state.theta, theta, rtol=1e-8)
    np.testing.assert_allclose(form.covariance(state.joint), PP, rtol=1e-8, atol=1e-8 * np.abs(PP).max())
    extended = spring_filter(ExtendedKalmanFilter, form)
    start = extended.start(jnp.zeros(2), jnp.array([2.0, 0.4]), jnp.eye(2))
    other, _ = over_runs(extended, start, alone(sequence(inputs, outputs, mask)), jnp.zeros((1, 2)))
    assert np.abs(other.theta - theta).max() > 1e-3


@pytest.mark.parametrize("kind", BOTH)
def test_on_line_and_off_line_give_the_same_numbers(kind):
    records = [spring_record(seed=seed) for seed in (4, 5)]
    runs = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(sequence(*record) for record in records))
    filter, starts = spring_filter(kind), jnp.array([[0.0, 0.0], [0.1, -0.1]])
    state = filter.start(starts[0], jnp.array([2.0, 0.4]), jnp.eye(2))
    last, estimates = jax.jit(lambda state: over_runs(filter, state, runs, starts))(state)
    step = on_line(filter)
    for run in range(2):
        state = filter.restart(state, starts[run])
        for k in range(80):
            state, estimate = step(state, at(runs, run, k))
            jax.tree.map(
                lambda a, b, run=run, k=k: np.testing.assert_allclose(a, b[run, k], rtol=1e-11, atol=1e-13),
                estimate,
                estimates,
            )
    np.testing.assert_allclose(state.joint, last.joint, rtol=1e-9, atol=1e-13)
    assert step._cache_size() == 1  # pyright: ignore[reportFunctionMemberAccess]


@pytest.mark.parametrize("form", FORMS, ids=["qr", "svd", "plain"])
def test_another_run_keeps_what_is_known_of_the_parameters_and_nothing_else(form):
    filter = spring_filter(ModifiedKalmanFilter, form)
    record = alone(sequence(*spring_record()))
    start = filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), jnp.eye(2))
    state, _ = over_runs(filter, start, record, jnp.zeros((1, 2)))
    again = filter.restart(state, jnp.ones(2))
    before, after = form.covariance(state.joint), form.covariance(again.joint)
    np.testing.assert_allclose(after[2:, 2:], before[2:, 2:], rtol=1e-10)
    np.testing.assert_allclose(after[:2], 0.05**2 * np.eye(2, 4), atol=1e-18)
    np.testing.assert_array_equal(again.theta, state.theta)
    np.testing.assert_array_equal(again.x, 1.0)


def test_samples_that_are_not_there_change_nothing():
    inputs, outputs, mask = spring_record()
    filter = spring_filter(ModifiedKalmanFilter)
    start = filter.start(jnp.zeros(2), jnp.array([2.0, 0.4]), jnp.eye(2))
    full = sequence(inputs, outputs, mask)
    real = jnp.arange(80) < 50
    gone = jnp.where(real[:, None], full.mask, False)
    padded = type(full)(full.inputs, jnp.where(real, full.elapsed, 0.0), full.outputs, gone)
    short = jax.tree.map(lambda leaf: leaf[:50], full)
    (a, _), (b, _) = (over_runs(filter, start, alone(samples), jnp.zeros((1, 2))) for samples in (padded, short))
    for name in ("x", "theta", "joint", "own"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("kind", BOTH)
def test_a_filter_that_diverges_says_so_and_stays_finite(kind):
    inputs, outputs, mask = spring_record()
    outputs[30] = 1e308
    filter = spring_filter(kind)
    thetas = jnp.array([[2.0, 0.4], [3.5, 1.0]])
    spoilt = sequence(inputs, outputs, np.ones_like(mask))
    lone = lambda theta: identify(filter, alone(spoilt), jnp.zeros((1, 2)), theta, jnp.eye(2))
    found = jax.vmap(lone)(thetas)
    assert found.diverged.all()
    assert np.isfinite(found.theta).all()
    start = filter.start(jnp.zeros(2), thetas[0], jnp.eye(2))
    _, estimates = over_runs(filter, start, alone(spoilt), jnp.zeros((1, 2)))
    assert not estimates.diverged[0, :30].any()
    assert estimates.diverged[0, 35:].all()
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(estimates))
    good = identify(filter, alone(sequence(*spring_record())), jnp.zeros((1, 2)), thetas[0], jnp.eye(2))
    assert not bool(good.diverged)


def test_a_second_pass_forgets_how_sure_the_first_was():
    filter, record = spring_filter(ModifiedKalmanFilter), alone(sequence(*spring_record()))
    at_theta = lambda theta, passes: identify(filter, record, jnp.zeros((1, 2)), theta, jnp.eye(2), passes)
    first = at_theta(jnp.array([2.0, 0.4]), 1)
    second, both = at_theta(first.theta, 1), at_theta(jnp.array([2.0, 0.4]), 2)
    np.testing.assert_allclose(both.trace, np.stack([first.theta, second.theta]), rtol=1e-12)
    np.testing.assert_allclose(both.covariance, second.covariance, rtol=1e-10)


def test_the_modified_filter_in_float32_survives_where_covariances_do_not():
    """Three weights known to 100 at first, of a state measured to 0.001.

    The measure: the estimated weights as one vector and each of their standard deviations, relative, after 200 samples.
    """
    rng = np.random.default_rng(1)
    inputs, x, outputs = np.float32(1.0 + rng.normal(size=(200, 3))), 0.0, []
    for u in inputs:
        x = x + 0.1 * (u @ np.array([1.0, -0.5, 0.8]) - 0.5 * x)
        outputs.append([x + 0.001 * rng.normal()])

    def run(form, dtype):
        single = lambda value: jnp.full((1, 1), np.float32(value), dtype)
        filter = ModifiedKalmanFilter(Driven(), ConstantNoise(single(0.003)), single(0.001), single(1.0), form)
        start = filter.start(jnp.zeros(1, dtype), jnp.zeros(3, dtype), 100.0 * jnp.eye(3, dtype=dtype))
        samples = alone(sequence(inputs, np.float32(outputs), dtype=dtype))
        return over_runs(filter, start, samples, jnp.zeros((1, 1), dtype))

    (low, seen), (high, reference), (plain, _) = (
        run(SquareRoot(), jnp.float32),
        run(SquareRoot(), jnp.float64),
        run(Covariance(), jnp.float32),
    )
    assert low.joint.dtype == low.theta.dtype == jnp.float32
    # some forty roundings of float32 in two hundred updates; most draws stay within ten
    assert np.linalg.norm(low.theta - high.theta) < 5e-6 * np.linalg.norm(high.theta)
    np.testing.assert_allclose(seen.theta_std[0, -1], reference.theta_std[0, -1], rtol=5e-6)
    assert np.linalg.svd(np.asarray(low.joint, float))[1].min() > 0.0
    assert not bool(low.diverged)
    covariance = np.asarray(plain.joint, float)
    assert np.linalg.eigvalsh(covariance + covariance.T)[0] < 0.0
    assert np.linalg.norm(plain.theta - high.theta) > 0.01 * np.linalg.norm(high.theta)
