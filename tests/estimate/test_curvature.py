"""A curvature by its parts: what it says against the dense matrix that they are parts of, by NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsub.estimate.curvature import Arrow, over_unit_diagonal

P, R, S = 5, 7, 3


def arrow(rank: int = P) -> Arrow:
    """Products of random columns of R runs, those of the parameters of a `rank`, a prior on the initial states."""
    rng = np.random.default_rng(3)
    theta = rng.standard_normal((R, 20, rank)) @ rng.standard_normal((rank, P)) * np.logspace(0, 3, P)
    start = rng.standard_normal((R, 20, S)) * 10.0
    cross = lambda a, b: jnp.asarray(np.einsum("rka,rkb->rab", a, b))
    return Arrow(cross(theta, theta).sum(0), cross(theta, start), cross(start, start) + jnp.eye(S))


VECTOR = jnp.asarray(np.random.default_rng(4).standard_normal(P + R * S))


def test_parts_say_what_the_whole_says():
    """Diagonal, products, damped solves and the coordinates of a unit diagonal, to rounding."""
    made = arrow()
    whole = np.asarray(made.dense())
    assert whole.shape == (P + R * S, P + R * S)
    np.testing.assert_allclose(made.diagonal(), np.diag(whole), rtol=1e-14)
    np.testing.assert_allclose(made.times(VECTOR), whole @ VECTOR, rtol=1e-12)
    for damping in (0.0, 0.3):
        expected = np.linalg.solve(whole + damping * np.eye(len(whole)), VECTOR)
        np.testing.assert_allclose(made.solve(VECTOR, jnp.asarray(damping)), expected, rtol=1e-9)
    scaled, size = over_unit_diagonal(made)
    np.testing.assert_allclose(scaled.diagonal(), 1.0, rtol=1e-14)
    np.testing.assert_allclose(scaled.dense(), whole / np.outer(size, size), atol=1e-14)


@pytest.mark.parametrize("rank", [P, P - 2])
def test_the_gain_leaves_out_what_nothing_tells(rank):
    """Half g' H⁺ g for a gradient that the data could have, by NumPy's pseudo-inverse."""
    scaled, _ = over_unit_diagonal(arrow(rank))
    whole = np.asarray(scaled.dense())
    gradient = whole @ np.asarray(VECTOR)
    expected = 0.5 * gradient @ np.linalg.pinv(whole, rcond=1e-11, hermitian=True) @ gradient
    assert np.linalg.matrix_rank(whole, tol=1e-10) == len(whole) - (P - rank)
    np.testing.assert_allclose(scaled.gain(jnp.asarray(gradient)), expected, rtol=1e-8)


def test_parts_and_whole_take_the_same_steps():
    """Solve and gain of an arrow and of the spectrum of the same matrix, in a batch of dampings too."""
    made = arrow()
    parts, _ = over_unit_diagonal(made)
    whole, _ = over_unit_diagonal(made.dense())
    damping = jnp.array([1e-10, 1e-3, 1.0])
    steps = lambda curvature: jax.vmap(lambda d: curvature.solve(VECTOR, d))(damping)
    np.testing.assert_allclose(steps(parts), steps(whole), rtol=1e-7)
    np.testing.assert_allclose(parts.gain(VECTOR), whole.gain(VECTOR), rtol=1e-9)


def test_what_is_held_stands_alone():
    """Claim: solves and gains without some coordinates are those of the matrix without their rows and columns."""
    parts, _ = over_unit_diagonal(arrow())
    held = np.zeros(P + R * S, bool)
    held[[1, 3, P, P + 7]] = True
    free = np.flatnonzero(~held)
    vector = jnp.where(held, 0.0, VECTOR)
    whole = np.asarray(parts.dense())[np.ix_(free, free)]
    for curvature in (
        parts.without(jnp.asarray(held)),
        over_unit_diagonal(parts.dense())[0].without(jnp.asarray(held)),
    ):
        step = np.asarray(curvature.solve(vector, jnp.asarray(0.3)))
        np.testing.assert_allclose(
            step[free], np.linalg.solve(whole + 0.3 * np.eye(len(free)), VECTOR[free]), rtol=1e-9
        )
        np.testing.assert_allclose(step[held], 0.0, atol=1e-14)
        expected = 0.5 * VECTOR[free] @ np.linalg.solve(whole, VECTOR[free])
        np.testing.assert_allclose(curvature.gain(vector), expected, rtol=1e-8)
