r"""Kalman algebra on square roots $P = JJ^T$, and on covariances for comparison (equations.md §4).

A square root has as many rows as the state; any such J serves, and `by_qr` gives the lower-triangular one. The paper
takes $L = (CJJ^TC^T + R)^c$; here L is the triangular factor of $[CJ, R^c]$, the same matrix without the square whose
rounding can leave it without a Cholesky factor. $^c$ is the lower Cholesky factor.

A missing channel has a zero row in C and, in R, a one on the diagonal and zeros beside it: its gain is zero and
nothing else feels it.
"""

import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Bool, Float

# so many rows are reflected without LAPACK, which takes a batch's matrices one by one: up to four times faster
_UNROLLED = 8


def by_qr(M: Float[Array, "n m"]) -> Float[Array, "n n"]:
    """The lower-triangular J of non-negative diagonal with J Jᵀ = M Mᵀ, m ≥ n: the R factor of Mᵀ."""
    if not 0 < len(M) <= _UNROLLED:
        R = jnp.linalg.qr(M.T, mode="r")
        return jnp.where(jnp.diag(R) < 0.0, -1.0, 1.0) * R.T
    columns = []
    for k in range(len(M)):
        column, M = _reflected(M)
        columns.append(jnp.concatenate([jnp.zeros(k, column.dtype), column]))
    return jnp.stack(columns, axis=1)


def _reflected(M: Float[Array, "n m"]) -> tuple[Float[Array, " n"], Float[Array, "l k"]]:
    """The first column of M and what is left below and beside it, after a Householder reflection of its first row."""
    a = M[0]
    along = M @ a
    none = along[0] == 0.0
    length = jnp.sqrt(jnp.where(none, 1.0, along[0]))
    column = along / length
    # of the vector [a₀ ± |a|, a₁ …] that the reflection turns round; of the two the one that does not cancel
    share = (column[1:] + jnp.where(a[0] < 0.0, -1.0, 1.0) * M[1:, 0]) / (length + jnp.abs(a[0]))
    return jnp.where(none, M[:, 0], column), M[1:, 1:] - share[:, None] * a[1:]


def by_svd(M: Float[Array, "n m"]) -> Float[Array, "n n"]:
    """A square J with J Jᵀ = M Mᵀ, m ≥ n: U S of the singular value decomposition."""
    U, S, _ = jnp.linalg.svd(M, full_matrices=False)
    return U * S


def stacked(F: Float[Array, "n q"], J: Float[Array, "q q2"], G: Float[Array, "n m"]) -> Float[Array, "n k"]:
    r"""$[FJ, G]$, a wide root of the predicted covariance $FPF^T + GG^T$; `by_qr` or `by_svd` makes it square."""
    return jnp.concatenate([F @ J, G], axis=1)


def present(
    C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "c n"], Float[Array, "c c"]]:
    r"""C and $R^c$ of the channels that `mask` has, the others neutral."""
    shared = jnp.where(mask[:, None] & mask[None, :], R_root @ R_root.T, jnp.diag(jnp.where(mask, 0.0, 1.0)))
    # a Cholesky factor squared and factored again is not quite itself
    root = jnp.where(jnp.all(mask), R_root, jnp.linalg.cholesky(shared))
    return jnp.where(mask[:, None], C, 0.0), root


def update(
    J: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
    r"""The gain K, the factor L of the innovation's covariance and the square root after a measurement.

    $K = JJ^TC^TL^{-T}L^{-1}$ and $J^+ = J[I - J^TC^TL^{-T}(L + R^c)^{-1}CJ]$ with `R_root` $= R^c$ lower triangular.
    Source: the manoeuvring paper, section 5; Andrews (1968), AIAA J. 6.
    """
    C, R_root = present(C, R_root, mask)
    rows, columns = jnp.concatenate([C @ J, J]), []
    for k in range(len(C)):
        noise = jnp.concatenate([R_root[k:, k], jnp.zeros(len(J), J.dtype)])
        column, rows = _reflected(jnp.concatenate([noise[:, None], rows], axis=1))
        columns.append(jnp.concatenate([jnp.zeros(k, J.dtype), column]))
    whole = jnp.stack(columns, axis=1)
    L, W = whole[: len(C)], whole[len(C) :]
    return solve_triangular(L, W.T, lower=True, trans=1).T, L, rows


def covariance_update(
    P: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
    """The same from the covariance P, by the standard form P⁺ = (I - K C) P."""
    C, R_root = present(C, R_root, mask)
    PC = P @ C.T
    L = jnp.linalg.cholesky(C @ PC + R_root @ R_root.T)
    gain = solve_triangular(L, solve_triangular(L, PC.T, lower=True), lower=True, trans=1).T
    return gain, L, P - gain @ PC.T
