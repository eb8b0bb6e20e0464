"""The square-root formulas are Kalman's: dense covariances agree, and in float32 fail first."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.filter.square_root import by_qr, by_svd, covariance_update, stacked, update

rng = np.random.default_rng(3)
N, C_ROWS = 5, 3


def matrices():
    """A square root that is not triangular, an output matrix and the lower factor of a full noise covariance."""
    J, C, R = rng.normal(size=(N, N)), rng.normal(size=(C_ROWS, N)), rng.normal(size=(C_ROWS, C_ROWS))
    return J, C, np.linalg.cholesky(R @ R.T + np.eye(C_ROWS))


def positive_definite(P):
    return bool(np.isfinite(P).all()) and bool(np.linalg.eigvalsh(P + P.T)[0] > 0.0)


def dense(P, C, R):
    """Kalman's gain and update in Joseph's form."""
    K = P @ C.T @ np.linalg.inv(C @ P @ C.T + R)
    kept = np.eye(len(P)) - K @ C
    return K, kept @ P @ kept.T + K @ R @ K.T


@pytest.mark.parametrize("square", [by_qr, by_svd])
def test_propagation_is_that_of_the_covariance(square):
    F, G = rng.normal(size=(N, N)), rng.normal(size=(N, 2))
    J = matrices()[0]
    found = square(stacked(jnp.asarray(F), jnp.asarray(J), jnp.asarray(G)))
    np.testing.assert_allclose(found @ found.T, F @ J @ J.T @ F.T + G @ G.T, rtol=1e-12, atol=1e-12)


def test_qr_gives_the_cholesky_factor():
    J = matrices()[0]
    np.testing.assert_allclose(by_qr(jnp.asarray(J)), np.linalg.cholesky(J @ J.T), rtol=1e-10, atol=1e-12)


def test_update_is_the_papers_and_kalmans():
    J, C, R_root = matrices()
    gain, L, after = update(*map(jnp.asarray, (J, C, R_root)), jnp.ones(C_ROWS, bool))
    # section 5, as printed
    paper_L = np.linalg.cholesky(C @ J @ J.T @ C.T + R_root @ R_root.T)
    paper_K = J @ J.T @ C.T @ np.linalg.inv(paper_L.T) @ np.linalg.inv(paper_L)
    inner = J.T @ C.T @ np.linalg.inv(paper_L.T) @ np.linalg.inv(paper_L + R_root) @ C @ J
    np.testing.assert_allclose(L, paper_L, atol=1e-12)
    np.testing.assert_allclose(gain, paper_K, atol=1e-12)
    np.testing.assert_allclose(after, J @ (np.eye(N) - inner), atol=1e-12)
    K, P = dense(J @ J.T, C, R_root @ R_root.T)
    np.testing.assert_allclose(gain, K, atol=1e-12)
    np.testing.assert_allclose(after @ after.T, P, atol=1e-11)


@pytest.mark.parametrize("mask", [(True, False, True), (False, True, False), (False, False, False)])
def test_missing_channels_are_as_if_the_sensors_were_not_there(mask):
    J, C, R_root = matrices()
    kept = np.array(mask)
    gain, _, after = jax.jit(update)(*map(jnp.asarray, (J, C, R_root)), jnp.asarray(kept))
    plain_gain, _, P_after = covariance_update(*map(jnp.asarray, (J @ J.T, C, R_root)), jnp.asarray(kept))
    K, P = dense(J @ J.T, C[kept], (R_root @ R_root.T)[np.ix_(kept, kept)])
    for found in (gain, plain_gain):
        np.testing.assert_array_equal(found[:, ~kept], 0.0)
        np.testing.assert_allclose(found[:, kept], K, atol=1e-11)
    for found in (after @ after.T, P_after):
        np.testing.assert_allclose(found, P, atol=1e-11)
    if not kept.any():
        np.testing.assert_array_equal(after, J)


def test_float32_survives_a_precise_measurement_after_a_vague_prior():
    """A body of which position, rate and acceleration are unknown to 100, and whose position is measured to 0.001.

    The measure: relative to each standard deviation, all entries of the covariance after the first twenty samples,
    which have shrunk it by ten decades. While it shrinks the square root keeps its rank, and its standard deviations
    are good to the 6e-8 of float32 times the 100/0.001 that are lost; the covariance gets a negative eigenvalue or
    worse.
    """
    dt = 0.25
    F, C = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    G, R_root = 0.01 * np.array([[dt**2 / 2], [dt], [1.0]]), np.array([[0.001]])
    model = [np.float32(matrix) for matrix in (F, G, C, R_root)]
    low, high = ([jnp.asarray(matrix, kind) for matrix in model] for kind in (jnp.float32, jnp.float64))
    seen = jnp.ones(1, bool)
    root = jax.jit(lambda J, F, G, C, R: update(by_qr(stacked(F, J, G)), C, R, seen)[2])
    plain = jax.jit(lambda P, F, G, C, R: covariance_update(F @ P @ F.T + G @ G.T, C, R, seen)[2])
    J, J_high, P = 100.0 * jnp.eye(3, dtype=jnp.float32), 100.0 * jnp.eye(3), 1e4 * jnp.eye(3, dtype=jnp.float32)
    lost = False
    for k in range(60):
        J, J_high, P = root(J, *low), root(J_high, *high), plain(P, *low)
        assert J.dtype == P.dtype == jnp.float32
        a, b = np.asarray(J, float), np.asarray(J_high)
        size = np.linalg.norm(b, axis=1)
        assert np.linalg.svd(a / size[:, None])[1].min() > 1e-4
        np.testing.assert_allclose(np.linalg.norm(a, axis=1), size, rtol=6e-3)
        if k >= 20:
            error = (a @ a.T - b @ b.T) / np.outer(size, size)
            assert np.linalg.norm(error) < 2e-6
        lost |= not positive_definite(np.asarray(P, float) / np.outer(size, size))
    assert lost
