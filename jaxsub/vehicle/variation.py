"""Motions of a vehicle some of whose numbers differ by run, one sample at a time: each may be of another run."""

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from ..effects import Motion

# what of a motion changes along a run, or from one run to the next
_MOVING = ("rates", "positions", "actuators", "environment", "buoyancy", "cruise", "time", "accelerations", "water")


def sample_by_sample(function: Callable[..., Any], shape: tuple[int, ...], *arguments: Any) -> Any:
    """The arrays that `function` of one sample gives at each, of `arguments` that have the leading axes `shape`.

    A motion among them has its inertia and actuation for all samples.
    """
    if not shape:
        return function(*arguments)
    moving = [{name: getattr(a, name) for name in _MOVING} if isinstance(a, Motion) else a for a in arguments]
    flat = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, shape).reshape(-1), moving)

    def one(*parts: Any) -> Any:
        pairs = zip(arguments, parts, strict=True)
        return function(*(dataclasses.replace(a, **part) if isinstance(a, Motion) else part for a, part in pairs))

    return jax.tree.map(lambda leaf: leaf.reshape(*shape, *leaf.shape[1:]), jax.vmap(one)(*flat))
