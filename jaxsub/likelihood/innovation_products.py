r"""The Kalman filter of many columns at once, and products of their innovations with exact derivatives.

All columns share the covariance, so one pass filters them side by side. A search for noise that makes them probable
wants the derivative by F, B and the noise of every sample; reverse differentiation of the pass would solve with the
factor of S many times over and keep what each operation met. The filter's adjoint is as short as the filter: with
$K = PC^TS^{-1}$, $u = S^{-1}E$ and the adjoints $\lambda, \Lambda$ of what follows a sample, $\lambda_f = F^T\lambda$,
$\Lambda_f = F^T\Lambda F$ before it and $\bar G$ of the products $G = \sum E^Tu$,

$\bar E = K^T\lambda_f + u(\bar G + \bar G^T),\quad
\bar S = K^T\Lambda_fK - \mathrm{sym}(K^T\lambda_fu^T) - \tfrac12u(\bar G + \bar G^T)u^T + \tfrac12\bar sS^{-1}$

and P, X take their shares of these. Source: de Jong (1991), Ann. Statist. 19, for many columns at once.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Float

from ..arrays import Values

T = TypeVar("T")

# samples whose innovations are held until their products are taken
_AT_ONCE = 64
# groups of columns whose products are taken once for each two of them, where there are more columns than a few
_GROUPS, _FEW = 4, 256


class Steps(NamedTuple):
    """R runs of K samples of z = [x, d], of which C sees the first s; q columns.

    **Fields**

    z ← F z - forcing + B w after each sample, forcing but the last; `noise` is the variance of each channel.
    """

    F: Float[Array, "r k z z"]
    B: Float[Array, "r k z n"]
    C: Float[Array, "r k c s"]
    noise: Float[Array, "r k c"]
    shown: Float[Values, "r k c q"]
    forcing: Float[Values, "r k1 s q"] | None


class Passed(NamedTuple):
    """What a filter meets at each sample.

    **Fields**

    - `white`: (R, K, c, q) the innovations of every column, whitened. `factor`: (R, K, c, c) of their covariance.
    - `half`: (R, K, c, z) the factor's inverse times C P. `P`, `X`: covariance and means before the sample was seen.
    """

    white: Float[Array, "r k c q"]
    factor: Float[Array, "r k c c"]
    half: Float[Array, "r k c z"]
    P: Float[Array, "r k z z"]
    X: Float[Array, "r k z q"]


def _met(carry: tuple[Array, Array], at: Steps) -> tuple[tuple[Array, Array], Passed]:
    """Covariance and means before the next sample, and what this one met."""
    P, X = carry
    c, s = at.C.shape
    across = at.C @ P[:s]
    factor = jnp.linalg.cholesky(across[:, :s] @ at.C.T + jnp.diag(at.noise))
    # products with a small inverse are far faster than to solve for very many columns
    inverse = solve_triangular(factor, jnp.eye(c, dtype=P.dtype), lower=True)
    half = inverse @ across
    white = inverse @ at.shown - (inverse @ at.C) @ X[:s]
    after = at.F @ X + (at.F @ half.T) @ white
    after = after if at.forcing is None else after.at[:s].add(-at.forcing)
    return (at.F @ (P - half.T @ half) @ at.F.T + at.B @ at.B.T, after), Passed(white, factor, half, P, X)


def beyond(M: Values) -> Array:
    """With a step more after the last sample, so that one loop serves all; it leads nowhere."""
    return jnp.concatenate([M, jnp.zeros_like(M[:, :1])], axis=1)


def passes(steps: Steps, begin: Float[Array, "z z"], of: Callable[[Passed], T]) -> T:
    """All runs, filtered from covariance `begin`: `of` what each sample meets, of all samples."""

    def step(carry: tuple[Array, Array], at: Steps) -> tuple[tuple[Array, Array], T]:
        carry, passed = _met(carry, at)
        return carry, of(passed)

    nothing = jnp.zeros((len(begin), steps.shown.shape[-1]), steps.shown.dtype)
    whole = steps if steps.forcing is None else steps._replace(forcing=beyond(steps.forcing))
    return jax.vmap(lambda at: jax.lax.scan(step, (begin, nothing), at)[1])(whole)


def part_length(samples: int, parts: int) -> int:
    """How many samples of a run of so many `samples` each of its `parts` has; the last may have fewer, or none."""
    pieces, length = _cut(samples, parts)
    return pieces * length


def _cut(samples: int, parts: int) -> tuple[int, int]:
    """How many pieces each part of a run is filtered in, and how many samples each of these has."""
    pieces = max(1, round(samples / parts / _AT_ONCE))
    return pieces, -(-samples // (parts * pieces))


def products_by_part(
    steps: Steps, begin: Float[Array, "z z"], parts: int
) -> tuple[Float[Array, "r m q q"], Float[Array, "r m"]]:
    """Products of the whitened innovations in each of `parts` of every run; half the log-determinant of each part.

    What is stored besides the steps are a few samples' innovations, however long the runs are. Samples are read where
    they lie, for copies of very many columns would take longer than to filter them.
    """
    return _filtered(steps, begin, parts)[:2]


def _filtered(
    steps: Steps, begin: Float[Array, "z z"], parts: int
) -> tuple[Float[Array, "r m q q"], Float[Array, "r m"], tuple[Float[Array, "r m b z z"], Float[Array, "r m b z q"]]]:
    """`products_by_part`, and covariance and means where each of the b pieces of a part begins."""
    q = steps.shown.shape[-1]
    pieces, length = _cut(steps.noise.shape[1], parts)

    def of_run(run: Steps) -> tuple[Array, Array, tuple[Array, Array]]:
        def met(carry: tuple[Array, Array], k: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
            carry, passed = _met(carry, _sample(run, k))
            return carry, (passed.white, jnp.sum(jnp.log(jnp.diagonal(passed.factor))))

        def piece(carry: tuple, first: Array) -> tuple[tuple, tuple]:
            before, gram = carry
            after, (white, logarithm) = jax.lax.scan(met, before, first + jnp.arange(length))
            flat = white.reshape(-1, q)
            return (after, gram + _squares(flat)), (jnp.sum(logarithm), before)

        def part(state: tuple[Array, Array], firsts: Array) -> tuple[tuple[Array, Array], tuple]:
            (state, gram), (logarithm, begun) = jax.lax.scan(piece, (state, jnp.zeros((q, q), nothing.dtype)), firsts)
            return state, (gram, jnp.sum(logarithm), begun)

        return jax.lax.scan(part, (begin, nothing), length * jnp.arange(parts * pieces).reshape(parts, pieces))[1]

    nothing = jnp.zeros((len(begin), q), steps.shown.dtype)
    # side by side, since matrices this small cost what it takes to begin with each
    gram, logarithm, begun = jax.vmap(of_run)(steps)
    return _mirrored(gram), logarithm, begun


def _squares(flat: Float[Array, "n q"]) -> Float[Array, "q q"]:
    """Products of all columns, those of two different groups of columns once: the upper triangle of blocks."""
    width = flat.shape[1]
    size = -(-width // (_GROUPS if width > _FEW else 1))
    rows = [
        jnp.pad(flat[:, first : first + size].T @ flat[:, first:], [(0, 0), (first, 0)])
        for first in range(0, width, size)
    ]
    return jnp.concatenate(rows)


def _mirrored(upper: Float[Array, "*m q q"]) -> Float[Array, "*m q q"]:
    """A symmetric matrix by its upper triangle."""
    return jnp.triu(upper) + jnp.swapaxes(jnp.triu(upper, 1), -1, -2)


def _sample(run: Steps, k: Array) -> Steps:
    """What a filter needs at sample `k` of one run: beyond the end nothing, with unit noise, that leads nowhere."""
    at = jax.tree.map(lambda M: M[jnp.minimum(k, len(M) - 1)], run)
    seen = lambda M, otherwise: jnp.where(k < len(run.noise), M, otherwise)
    return at._replace(F=seen(at.F, 0.0), C=seen(at.C, 0.0), noise=seen(at.noise, 1.0), shown=seen(at.shown, 0.0))


def innovation_products(steps: Steps, begin: Float[Array, "z z"]) -> tuple[Float[Array, "q q"], Float[Array, ""]]:
    """Products of the whitened innovations of all columns, and half the log-determinant of their covariance."""
    return products_and_begun(steps, begin)[0]


# covariance (R, B, z, z) and means (R, B, z, q) where each of the B pieces of a run begins
Begun = tuple[Array, Array]


def products_and_begun(steps: Steps, begin: Float[Array, "z z"]) -> tuple[tuple[Array, Array], Begun]:
    """`innovation_products`, and what `products_adjoint` needs beside the steps."""
    gram, log_determinant, begun = _filtered(steps, begin, 1)
    return (jnp.sum(gram, (0, 1)), jnp.sum(log_determinant)), jax.tree.map(lambda M: M[:, 0], begun)


class Derivatives(NamedTuple):
    """Derivatives of a function of `innovation_products`.

    **Fields**: by F, B and noise of the `Steps` and by the covariance that they `begin` with; `residual`: (R, K, c) by
    what the first column shows.
    """

    F: Float[Array, "r k z z"]
    B: Float[Array, "r k z n"]
    noise: Float[Array, "r k c"]
    begin: Float[Array, "z z"]
    residual: Float[Array, "r k c"]


def products_adjoint(
    steps: Steps, begun: Begun, by_gram: Float[Array, "q q"], by_log_determinant: Float[Array, ""]
) -> Derivatives:
    """The derivatives of a function that has these by both of `innovation_products`.

    Piece by piece from the last: what a piece met is worked out again from where it begins.
    """
    both, log_determinant = by_gram + by_gram.T, by_log_determinant
    samples, (z, q) = steps.noise.shape[1], begun[1].shape[-2:]
    pieces, length = _cut(samples, 1)

    def of_run(run: Steps, begun: tuple[Array, Array]) -> tuple[tuple[Array, ...], Array]:
        def piece(after: tuple[Array, Array], each: tuple[Array, tuple]) -> tuple[tuple[Array, Array], tuple]:
            first, before = each
            at = jax.vmap(lambda k: _sample(run, k))(first + jnp.arange(length))
            passed = jax.lax.scan(_met, before, at)[1]
            u, gain, inverse = _solved(passed)
            # of all samples at once: one large product
            pull = (u.reshape(-1, q) @ both).reshape(u.shape)
            return jax.lax.scan(
                lambda carry, met: _back_step(carry, *met, log_determinant),
                after,
                (at, passed, u, gain, inverse, pull),
                reverse=True,
            )

        nothing = jnp.zeros((z, q), begun[1].dtype), jnp.zeros((z, z), begun[1].dtype)
        firsts = length * jnp.arange(pieces)
        (_, weight), found = jax.lax.scan(piece, nothing, (firsts, begun), reverse=True)
        return jax.tree.map(lambda M: M.reshape(-1, *M.shape[2:])[:samples], found), weight

    (F, B, noise, residual), weights = jax.vmap(of_run)(steps, begun)
    return Derivatives(F, B, noise, jnp.sum(weights, axis=0), residual)


def _solved(passed: Passed) -> tuple[Array, Array, Array]:
    """u, the gain's transpose and the inverse of the innovations' covariance, at all samples."""
    c, q = passed.white.shape[-2:]
    one = jnp.broadcast_to(jnp.eye(c, dtype=passed.factor.dtype), passed.factor.shape)
    inverse_factor = solve_triangular(passed.factor, one, lower=True)
    every = jnp.concatenate([passed.white, passed.half, inverse_factor], axis=-1)
    solved = jnp.swapaxes(inverse_factor, -1, -2) @ every
    return solved[..., :q], solved[..., q:-c], solved[..., -c:]


def _back_step(
    carry: tuple[Array, Array],
    at: Steps,
    passed: Passed,
    u: Array,
    gain: Array,
    inverse: Array,
    pull: Array,
    log_determinant: Array,
) -> tuple[tuple[Array, Array], tuple[Array, Array, Array, Array]]:
    """The adjoints before a sample by those after it, and the derivatives by F, B, noise and residual there."""
    lever, weight = carry
    s = at.C.shape[1]
    filtered = passed.X + passed.half.T @ passed.white, passed.P - passed.half.T @ passed.half
    left, weighed = at.F.T @ lever, at.F.T @ weight
    of_F, of_B = lever @ filtered[0].T + 2.0 * weight @ at.F @ filtered[1], 2.0 * weight @ at.B
    weight = weighed @ at.F
    weighted, kept = gain @ left, gain @ weight
    of_E = weighted + pull
    mixed = (weighted + 0.5 * pull) @ u.T
    of_S = kept @ gain.T - 0.5 * (mixed + mixed.T) + 0.5 * log_determinant * inverse
    of_across = (u @ left.T - 2.0 * kept).at[:, :s].add(of_S @ at.C)
    share = at.C.T @ of_across
    weight = weight.at[:s].add(0.5 * share).at[:, :s].add(0.5 * share.T)
    lever = left.at[:s].add(-at.C.T @ of_E)
    return (lever, weight), (of_F, of_B, jnp.diagonal(of_S), of_E[:, 0])
