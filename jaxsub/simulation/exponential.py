r"""The sampled step: exact for the linear part (the first paper's eq. 2), of order four for the rest.

With $\dot x = Lx + N(x, t)$ and L acting on the velocities, the scheme is Cox and Matthews' ETDRK4 (2002,
J. Comput. Phys. 176): for constant N it is eq. 2 whatever the step, for L = 0 the classical Runge–Kutta scheme.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_TERMS, _DOUBLINGS = 10, 12
Phi = tuple[Array, Array, Array, Array]


def phi_functions(A: Float[Array, "n n"]) -> Phi:
    r"""$e^A$ and $\varphi_k(A) = \sum_j A^j/(j+k)!$ for k = 1, 2, 3, also where A is singular.

    Taylor series of $A/2^s$, then s doublings
    $\varphi_k(2A) = 2^{-k}[e^A\varphi_k(A) + \sum_{j=1}^k \varphi_j(A)/(k-j)!]$.
    This is the block-matrix exponential worked out by blocks of n × n instead of 4n × 4n; good to rounding for
    $\|A\| < 2^{s-1}$ with s = 12. Source: Skaflestad and Wright (2009), Appl. Numer. Math. 59.
    """
    eye = jnp.eye(A.shape[0], dtype=A.dtype)
    small = A / 2**_DOUBLINGS

    def add(carry: tuple[Array, Phi], j: Array) -> tuple[tuple[Array, Phi], None]:
        power, (e, p1, p2, p3) = carry
        term = power @ small / j
        first, second = term / (j + 1.0), term / ((j + 1.0) * (j + 2.0))
        return (term, (e + term, p1 + first, p2 + second, p3 + second / (j + 3.0))), None

    constant = (eye, eye, eye / 2.0, eye / 6.0)
    (_, phi), _ = jax.lax.scan(add, (eye, constant), jnp.arange(1, _TERMS, dtype=A.dtype))
    return jax.lax.scan(lambda phi, _: (doubled(phi), None), phi, None, length=_DOUBLINGS)[0]


def doubled(phi: Phi) -> Phi:
    """The functions of $2A$ from those of A."""
    e, p1, p2, p3 = phi
    return e @ e, (e @ p1 + p1) / 2.0, (e @ p2 + p1 + p2) / 4.0, (e @ p3 + p1 / 2.0 + p2 + p3) / 8.0


class StepTable(eqx.Module):
    """Weights of the scheme for S step lengths h (s), or for one: matrices for the velocities, where L acts.

    **Fields**

    - `h`: (S,). `full`, `half`: (S, n, n) $e^{Lh}$, $e^{Lh/2}$. `stage`: $\\tfrac h2\\varphi_1(Lh/2)$.
    - `first`, `middle`, `last`: weights of N at the start, at each of the two middle stages, and at the end.
    """

    h: Float[Array, " *s"]
    full: Float[Array, "*s n n"]
    half: Float[Array, "*s n n"]
    stage: Float[Array, "*s n n"]
    first: Float[Array, "*s n n"]
    middle: Float[Array, "*s n n"]
    last: Float[Array, "*s n n"]

    def at(self, index: Array) -> "StepTable":
        """The weights of one step length."""
        return jax.tree.map(lambda leaf: leaf[index], self)


def step_table(L: Float[Array, "n n"], h: Float[Array, " s"]) -> StepTable:
    """The weights for the linear part `L` (1/s) and step lengths `h` (s)."""

    def weights(length: Array) -> StepTable:
        of_half = phi_functions(0.5 * length * L)
        half, p1_half, _, _ = of_half
        full, p1, p2, p3 = doubled(of_half)
        first, middle, last = p1 - 3.0 * p2 + 4.0 * p3, 2.0 * p2 - 4.0 * p3, 4.0 * p3 - p2
        return StepTable(length, full, half, 0.5 * length * p1_half, length * first, length * middle, length * last)

    return jax.vmap(weights)(h)


Rates = Callable[[Array, Array, Array], tuple[Array, Array]]


def exponential_step(
    rates: Rates,
    table: StepTable,
    velocity: Float[Array, " n"],
    position: Float[Array, " q"],
    nodes: Float[Array, "3 m"],
) -> tuple[Float[Array, " n"], Float[Array, " q"]]:
    """Velocity and position after one step.

    `rates(velocity, position, node)` gives $N$, the velocity's rate without its linear part, and the position's rate;
    `nodes` are the signals at the start, middle and end; `table` holds the weights of one step length.
    """
    h = table.h
    n0, p0 = rates(velocity, position, nodes[0])
    half = table.half @ velocity
    a, a_position = half + table.stage @ n0, position + 0.5 * h * p0
    n1, p1 = rates(a, a_position, nodes[1])
    b, b_position = half + table.stage @ n1, position + 0.5 * h * p1
    n2, p2 = rates(b, b_position, nodes[1])
    c, c_position = table.half @ a + table.stage @ (2.0 * n2 - n0), position + h * p2
    n3, p3 = rates(c, c_position, nodes[2])
    velocity = table.full @ velocity + table.first @ n0 + table.middle @ (n1 + n2) + table.last @ n3
    return velocity, position + h / 6.0 * (p0 + 2.0 * (p1 + p2) + p3)
