r"""A small quadratic program with limits that hold and limits that yield, by a primal-dual interior point."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

# of the way to the nearest limit
_PART = 0.99


class Quadratic(eqx.Module):
    r"""$\min_d \tfrac12 d^THd + q^Td + \sum_i \tfrac{1}{2w_i}\max(0, (Gd + g)_i)^2$.

    A yield $w_i$ of zero makes the limit hard: $(Gd + g)_i \le 0$, which some d has to keep.

    **Fields**

    - `H`: (d, d) positive definite. `q`: (d,). `G`: (c, d). `g`, `w`: (c,).
    """

    H: Float[Array, "d d"]
    q: Float[Array, " d"]
    G: Float[Array, "c d"]
    g: Float[Array, " c"]
    w: Float[Array, " c"]


def quadratic_minimum(problem: Quadratic, steps: int = 30, gap: float = 1e-8) -> tuple[Array, Array]:
    r"""The minimum d (d,) and the multipliers $\lambda$ (c,): $Hd + q + G^T\lambda = 0$.

    With slacks s of $Gd + g + s = w\lambda$ a Newton step has the matrix $H + G^T\mathrm{diag}(s/\lambda + w)^{-1}G$;
    Mehrotra's predictor and corrector share its factor. Ends where the mean of $s\lambda$ and all residuals are below
    `gap`, or after `steps`. Source: Nocedal and Wright (2006), §16.6.
    """
    H, q, G, g, w = problem.H, problem.q, problem.G, problem.g, problem.w
    size = max(g.size, 1)

    def residuals(d: Array, multipliers: Array, slack: Array) -> tuple[Array, Array]:
        return H @ d + q + G.T @ multipliers, G @ d + g + slack - w * multipliers

    def more(carry: tuple[Array, ...]) -> Array:
        d, multipliers, slack, k = carry
        dual, primal = residuals(d, multipliers, slack)
        left = jnp.maximum(jnp.max(jnp.abs(dual)), jnp.max(jnp.abs(primal), initial=0.0))
        return (k < steps) & (jnp.maximum(left, slack @ multipliers / size) > gap)

    def again(carry: tuple[Array, ...]) -> tuple[Array, ...]:
        d, multipliers, slack, k = carry
        dual, primal = residuals(d, multipliers, slack)
        give = slack / multipliers + w
        factor = jax.scipy.linalg.cho_factor(H + (G.T / give) @ G)

        def direction(product: Array) -> tuple[Array, Array, Array]:
            """Towards slack times multiplier less by `product`."""
            pull = (primal - product / multipliers) / give
            moved = jax.scipy.linalg.cho_solve(factor, -dual - G.T @ pull)
            grown = (G @ moved) / give + pull
            return moved, grown, -(product + slack * grown) / multipliers

        product = slack * multipliers
        mean = jnp.sum(product) / size
        _, grown, opened = direction(product)
        most = _longest(multipliers, grown), _longest(slack, opened)
        ahead = (slack + most[1] * opened) @ (multipliers + most[0] * grown) / size
        centre = (ahead / jnp.maximum(mean, 1e-300)) ** 3 * mean
        moved, grown, opened = direction(product + grown * opened - centre)
        part = _PART * jnp.minimum(_longest(multipliers, grown), _longest(slack, opened))
        return d + part * moved, multipliers + part * grown, slack + part * opened, k + 1

    first = jnp.maximum(-g, 1.0)
    start = (jnp.zeros_like(q), jnp.ones_like(g), first, jnp.asarray(0))
    d, multipliers, _, _ = jax.lax.while_loop(more, again, start)
    return d, multipliers


def _longest(values: Float[Array, " c"], moves: Float[Array, " c"]) -> Float[Array, ""]:
    """The part of `moves`, at most one, that leaves `values` positive."""
    shrinks = moves < 0.0
    return jnp.min(jnp.where(shrinks, -values / jnp.where(shrinks, moves, -1.0), 1.0), initial=1.0)
