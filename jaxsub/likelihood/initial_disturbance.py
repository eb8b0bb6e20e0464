"""A disturbance that a search starts from, by the residuals and by what lasting forces would do."""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..programs import compiled
from .disturbance import Disturbance, System
from .sensitivity import propagate


class Response(NamedTuple):
    """What a first guess of the disturbance takes of some runs.

    **Fields**: `effect`: (n,) squares of what a lasting unit force in each equation does to the outputs, (N, N m)⁻².
    `residual`: squares. `duration`: s, and `intervals`: their number, of the longest run.
    """

    effect: Float[Values, " n"]
    residual: Float[Values, ""]
    duration: Float[Values, ""]
    intervals: Float[Values, ""]


@compiled
def response(system: System, residual: Float[Array, "r k c"]) -> Response:
    """The response of a linearised `system`, and its `residual` (R, K, c) in σ."""
    n, r = system.G.shape[3] // 2, len(system.intervals)
    steady = system.G[..., :n] + system.G[..., n:]
    effect = system.C @ propagate(system.A, steady, jnp.zeros((r, system.A.shape[-1], n)))
    longest = jnp.max(jnp.sum(system.intervals, axis=1)), jnp.max(jnp.sum(system.intervals > 0.0, axis=1))
    return Response(jnp.sum(effect**2, (0, 1, 2)), jnp.sum(residual**2), longest[0], longest[1] + 0.0)


def first_guess(parts: Sequence[Response], channels: int) -> Disturbance:
    """A disturbance to start from: in each equation a force whose lasting effect is as large as the residual.

    `parts` are the responses of all runs, and `channels` how many they have.
    """
    xp = namespace(*parts[0])
    effect, residual = xp.sqrt(sum(part.effect for part in parts)), xp.sqrt(sum(part.residual for part in parts))
    longest = lambda name: xp.max(xp.stack([getattr(part, name) for part in parts]))
    slow = longest("duration") / xp.sqrt(longest("intervals"))
    force = residual / xp.where(effect > 0.0, effect, 1.0)
    return Disturbance(force, xp.full(len(effect), slow), xp.ones(channels))
