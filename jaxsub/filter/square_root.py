r"""Kalman algebra on square roots $P = JJ^T$, and on covariances for comparison (the first paper's section 5).

A square root has as many rows as the state; any such J serves, and `by_qr` gives the lower-triangular one. The paper
takes $L = (CJJ^TC^T + R)^c$; here L is the triangular factor of $[CJ, R^c]$, the same matrix without the square whose
rounding can leave it without a Cholesky factor. $^c$ is the lower Cholesky factor.

A missing channel has a zero row in C and, in R, a one on the diagonal and zeros beside it: its gain is zero and
nothing else feels it.
"""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .small import UNROLLED, backward, cholesky, forward, times


def by_qr(M: Float[Array, "n m"]) -> Float[Array, "n n"]:
    """The lower-triangular J of non-negative diagonal with J Jᵀ = M Mᵀ, m ≥ n: the R factor of Mᵀ."""
    if not 0 < len(M) <= UNROLLED:
        R = jnp.linalg.qr(M.T, mode="r")
        return jnp.where(jnp.diag(R) < 0.0, -1.0, 1.0) * R.T
    columns = []
    for k in range(len(M)):
        column, share = _reflected(M @ M[0], M[:, 0])
        columns.append(jnp.pad(column, (k, 0)))
        M = M[1:, 1:] - share[:, None] * M[0, 1:]
    return jnp.stack(columns, axis=1)


def _reflected(along: Float[Array, " n"], first: Float[Array, " n"]) -> tuple[Float[Array, " n"], Float[Array, " l"]]:
    """The `first` column of M after a Householder reflection of its first row a, and what the rows below lose of a.

    `along` is M a. That share of a, less its first element, is to be taken from what is beside the column.
    """
    none = along[0] == 0.0
    length = jnp.sqrt(jnp.where(none, 1.0, along[0]))
    column = along / length
    # of the vector [a₀ ± |a|, a₁ …] that the reflection turns round; of the two the one that does not cancel
    share = (column[1:] + jnp.where(first[0] < 0.0, -1.0, 1.0) * first[1:]) / (length + jnp.abs(first[0]))
    return jnp.where(none, first, column), share


def by_svd(M: Float[Array, "n m"]) -> Float[Array, "n n"]:
    """A square J with J Jᵀ = M Mᵀ, m ≥ n: U S of the singular value decomposition."""
    U, S, _ = jnp.linalg.svd(M, full_matrices=False)
    return U * S


def stacked(F: Float[Array, "n q"], J: Float[Array, "q q2"], G: Float[Array, "n m"]) -> Float[Array, "n k"]:
    r"""$[FJ, G]$, a wide root of the predicted covariance $FPF^T + GG^T$; `by_qr` or `by_svd` makes it square."""
    return jnp.concatenate([times(F, J), G], axis=1)


def present(
    C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "c n"], Float[Array, "c c"]]:
    r"""C and $R^c$ of the channels that `mask` has, the others neutral."""
    shared = jnp.where(mask[:, None] & mask[None, :], R_root @ R_root.T, jnp.diag(jnp.where(mask, 0.0, 1.0)))
    # a Cholesky factor squared and factored again is not quite itself
    root = jnp.where(jnp.all(mask), R_root, cholesky(shared))
    return jnp.where(mask[:, None], C, 0.0), root


def update(
    J: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
    r"""The gain K, the factor L of the innovation's covariance and the square root after a measurement.

    $K = JJ^TC^TL^{-T}L^{-1}$ and $J^+ = J[I - J^TC^TL^{-T}(L + R^c)^{-1}CJ]$ with `R_root` $= R^c$ lower triangular.
    Source: the manoeuvring paper, section 5; Andrews (1968), AIAA J. 6.
    """
    C, R_root = present(C, R_root, mask)
    rows, columns = jnp.concatenate([times(C, J), J]), []
    for k in range(len(C)):
        # [Rᶜ, CJ] over [0, J], whose columns of noise wait beside the others for their turn
        noise = jnp.pad(R_root[k:, k], (0, len(J)))
        column, share = _reflected(noise * noise[0] + rows @ rows[0], noise)
        columns.append(jnp.pad(column, (k, 0)))
        rows = rows[1:] - share[:, None] * rows[0]
    whole = jnp.stack(columns, axis=1)
    L, W = whole[: len(C)], whole[len(C) :]
    return backward(L, W.T).T, L, rows


def covariance_update(
    P: Float[Array, "n n"], C: Float[Array, "c n"], R_root: Float[Array, "c c"], mask: Bool[Array, " c"]
) -> tuple[Float[Array, "n c"], Float[Array, "c c"], Float[Array, "n n"]]:
    """The same from the covariance P, by the standard form P⁺ = (I - K C) P."""
    C, R_root = present(C, R_root, mask)
    PC = times(P, C.T)
    L = cholesky(times(C, PC) + R_root @ R_root.T)
    gain = backward(L, forward(L, PC.T)).T
    return gain, L, P - times(gain, PC.T)
