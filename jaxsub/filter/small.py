"""Algebra of matrices of up to eight rows, written out: sums of outer products and rows, one after the other.

XLA on a CPU calls a routine for each product, factorisation and solution, in a batch for each of its matrices. Written
out, they are loops over whole arrays that fuse with what stands beside them: in a batch of thousands a product of seven
by seven takes a fifth of the time, a solution with a factor of three by three a sixth, and a single step has no call to
make. Compiling takes longer with the square of the size, and what is gained shrinks: above eight the routines serve.
"""

import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Float

UNROLLED = 8


def times(A: Float[Array, "n k"], B: Float[Array, "k m"]) -> Float[Array, "n m"]:
    """A B as a sum of k outer products."""
    k = len(B)
    if not 0 < k <= UNROLLED:
        return A @ B
    return sum((A[:, i, None] * B[i] for i in range(1, k)), start=A[:, 0, None] * B[0])


def cholesky(S: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """The lower-triangular L with L Lᵀ = S of a symmetric S; not finite where S is not positive definite."""
    n, columns = len(S), []
    if not 0 < n <= UNROLLED:
        return jnp.linalg.cholesky(S)
    for k in range(n):
        column = S[:, 0] / jnp.sqrt(S[0, 0])
        columns.append(jnp.pad(column, (k, 0)))
        S = S[1:, 1:] - column[1:, None] * column[1:]
    return jnp.stack(columns, axis=1)


def forward(L: Float[Array, "n n"], B: Float[Array, "n m"]) -> Float[Array, "n m"]:
    """L⁻¹ B of a lower-triangular L."""
    if not 0 < len(L) <= UNROLLED:
        return solve_triangular(L, B, lower=True)
    rows = []
    for k, row in enumerate(B):
        for j, known in enumerate(rows):
            row = row - L[k, j] * known
        rows.append(row / L[k, k])
    return jnp.stack(rows)


def backward(L: Float[Array, "n n"], B: Float[Array, "n m"]) -> Float[Array, "n m"]:
    """L⁻ᵀ B of a lower-triangular L."""
    if not 0 < len(L) <= UNROLLED:
        return solve_triangular(L, B, lower=True, trans=1)
    return forward(L.T[::-1, ::-1], B[::-1])[::-1]
