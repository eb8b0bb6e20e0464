r"""The sampled step and its derivatives: those of the rates at its four stages, put together by the scheme.

On the whole state, of which positions have no linear part, a step of `exponential_step` from x is
$a = E_hx + Sr_0$, $b = E_hx + Sr_1$, $c = E_ha + S(2r_2 - r_0)$ and $x' = Ex + W_fr_0 + W_m(r_1 + r_2) + W_lr_3$, where
$r_i$ are the rates at x, a, b and c. Only these are differentiated, of all stages at once; the rest is the chain rule
from the last stage back to the first, in products of (s, s).
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .exponential import StepTable
from .sampled import Sampled, subdivided

# which of the nodes at the start, middle and end each stage is at
_NODE = np.array([0, 1, 1, 2])


class Slopes(NamedTuple):
    """Derivatives of what steps by p parameters: of the `model`, p leading, and of one interval's `nodes` (p, 3, m)."""

    model: Sampled
    nodes: Float[Array, "p 3 m"]


class LinearisedStep(NamedTuple):
    """The state one sample later and its derivatives, SI.

    **Fields**

    - `after`: (s,). `A`: (s, s) by the state. `G`: (s, 2n) by a force at the interval's start, and at its end.
    - `F`: (s, p) by the parameters.
    """

    after: Float[Array, " s"]
    A: Float[Array, "s s"]
    G: Float[Array, "s n2"]
    F: Float[Array, "s p"]


def linearised_step(
    model: Sampled,
    state: Float[Array, " s"],
    nodes: Float[Array, "3 m"],
    index: Array,
    push: Float[Array, "2 n"],
    slopes: Slopes,
) -> LinearisedStep:
    """`model.step(state, nodes, index, push)` and its derivatives.

    `state` (s,), `nodes` (3, m), `index` and `push` (2, n) are as of `Sampled.step`; `slopes` are those of the model
    and the nodes.
    """
    parts, s, p = model.substeps, len(state), len(slopes.nodes)
    # shares of the two forces at the nodes of each part, linear between
    at = np.linspace(0.0, 1.0, 2 * parts + 1)[2 * np.arange(parts)[:, None] + np.arange(3)]
    every = (
        subdivided(nodes, parts),
        jnp.asarray(np.stack([1.0 - at, at], axis=-1)),
        jax.vmap(lambda one: subdivided(one, parts), out_axes=1)(slopes.nodes),
    )

    def one(state: Array, nodes: Array, shares: Array, by: Array) -> LinearisedStep:
        return _step(model, state, nodes, index, shares, push, Slopes(slopes.model, by))

    def advance(before: LinearisedStep, part: tuple[Array, Array, Array]) -> tuple[LinearisedStep, None]:
        after, A, G, F = one(before.after, *part)
        return LinearisedStep(after, A @ before.A, A @ before.G + G, A @ before.F + F), None

    if parts == 1:
        return one(state, *(leaf[0] for leaf in every))
    begin = LinearisedStep(state, jnp.eye(s), jnp.zeros((s, push.size)), jnp.zeros((s, p)))
    return jax.lax.scan(advance, begin, every)[0]


def _step(
    model: Sampled,
    state: Float[Array, " s"],
    nodes: Float[Array, "3 m"],
    index: Array,
    shares: Float[Array, "3 2"],
    push: Float[Array, "2 n"],
    slopes: Slopes,
) -> LinearisedStep:
    """One step of the scheme; `shares` (3, 2) are those that the forces `push` have at its nodes."""
    n, s = len(model.inverse), len(state)
    numbers, others = eqx.partition(model, eqx.is_inexact_array)
    by_numbers = eqx.filter(slopes.model, eqx.is_inexact_array)

    # compiled apart so that the four stages are traced once
    @jax.jit
    def rates(numbers: Sampled, state: Array, node: Array, share: Array) -> Float[Array, " s"]:
        return jnp.concatenate(eqx.combine(numbers, others).rates(state[:n], state[n:], node, share @ push))

    def by_parameters(state: Array, node: Array, share: Array, by_node: Array) -> Float[Array, "s p"]:
        at_rest = lambda numbers, node: rates(numbers, state, node, share)
        along = lambda *tangents: jax.jvp(at_rest, (numbers, node), tangents)[1]
        return jax.vmap(along, out_axes=-1)(by_numbers, by_node)

    scheme = _on_states(model.table.at(index), s)
    own = (nodes[_NODE], shares[_NODE])
    states, moved, after = _stages(scheme, lambda *at: rates(numbers, *at), state, *own)
    A, through, W = _chained(scheme, jax.vmap(jax.jacfwd(rates, 1), (None, 0, 0, 0))(numbers, states, *own))
    G = jnp.einsum("isn,nm,iw->swm", W[..., :n], model.inverse, own[1]).reshape(s, -1)
    by_rates = jax.vmap(by_parameters, (0, 0, 0, 1))(states, *own, slopes.nodes[:, _NODE])
    by_table = jax.vmap(lambda table: table.at(index))(slopes.model.table)
    inner, last = _by_weights(by_table, states[:, :n], moved[:, :n])
    # one product, since many small ones take longer
    F = jnp.concatenate([*through[..., :n], *W], axis=1) @ jnp.concatenate([*inner, *by_rates])
    return LinearisedStep(after, A, G, F.at[:n].add(last))


def _on_states(table: StepTable, s: int) -> StepTable:
    """The weights of one step length on all s states."""
    n, h = len(table.full), table.h
    own = np.diag(np.arange(s) >= n)
    on = lambda weight, of_positions: jnp.pad(weight, (0, s - n)) + of_positions * own
    return StepTable(
        h,
        full=on(table.full, 1.0),
        half=on(table.half, 1.0),
        stage=on(table.stage, h / 2.0),
        first=on(table.first, h / 6.0),
        middle=on(table.middle, h / 3.0),
        last=on(table.last, h / 6.0),
    )


def _stages(
    scheme: StepTable, rates: Callable[..., Array], state: Array, nodes: Array, shares: Array
) -> tuple[Array, Array, Array]:
    """States of the stages and the rates there, (4, s), and the state after the step."""
    half = scheme.half @ state
    r0 = rates(state, nodes[0], shares[0])
    a = half + scheme.stage @ r0
    r1 = rates(a, nodes[1], shares[1])
    b = half + scheme.stage @ r1
    r2 = rates(b, nodes[2], shares[2])
    c = scheme.half @ a + scheme.stage @ (2.0 * r2 - r0)
    r3 = rates(c, nodes[3], shares[3])
    after = scheme.full @ state + scheme.first @ r0 + scheme.middle @ (r1 + r2) + scheme.last @ r3
    return jnp.stack([state, a, b, c]), jnp.stack([r0, r1, r2, r3]), after


def _chained(scheme: StepTable, J: Float[Array, "4 s s"]) -> tuple[Array, Array, Array]:
    """The step's derivatives by the state (s, s), by the states a, b, c (3, s, s), and by the four rates (4, s, s).

    `J` are those of the rates by the states of the stages.
    """
    last = scheme.last
    c = last @ J[3]
    third = scheme.middle + 2.0 * c @ scheme.stage
    b = third @ J[2]
    second = scheme.middle + b @ scheme.stage
    a = second @ J[1] + c @ scheme.half
    first = scheme.first + (a - c) @ scheme.stage
    A = scheme.full + (a + b) @ scheme.half + first @ J[0]
    return A, jnp.stack([a, b, c]), jnp.stack([first, second, third, last])


def _by_weights(by: StepTable, v: Float[Array, "4 n"], r: Float[Array, "4 n"]) -> tuple[Array, Array]:
    """What the weights' derivatives `by` p parameters do to the velocities of a, b, c (3, n, p) and at the end (n, p).

    `v` and `r` are the velocities of the stages and their rates.
    """
    inner = jnp.concatenate([by.half, by.stage], axis=-1)
    on = jnp.concatenate([v[np.array([0, 0, 1])], jnp.stack([r[0], r[1], 2.0 * r[2] - r[0]])], axis=-1)
    last = jnp.concatenate([by.full, by.first, by.middle, by.last], axis=-1)
    whole = jnp.concatenate([v[0], r[0], r[1] + r[2], r[3]])
    return jnp.einsum("pij,kj->kip", inner, on), jnp.einsum("pij,j->ip", last, whole)
