"""Forces of a vehicle some of whose numbers differ by run."""

import dataclasses
from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..effects import Motion

# what of a motion changes along a run, or from one run to the next
_MOVING = ("rates", "positions", "actuators", "environment", "buoyancy", "cruise", "time", "accelerations", "water")


def sample_by_sample(
    force: Callable[[Motion], Float[Array, " n"]], motion: Motion, shape: tuple[int, ...]
) -> Float[Array, "*k n"]:
    """A force of one sample at each of a motion's samples, which have the leading axes `shape`."""
    if not shape:
        return force(motion)
    flat = lambda leaf: jnp.broadcast_to(leaf, shape).reshape(-1)
    moving = jax.tree.map(flat, {name: getattr(motion, name) for name in _MOVING})
    found = jax.vmap(lambda parts: force(dataclasses.replace(motion, **parts)))(moving)
    return found.reshape(*shape, -1)
