"""The loop that every manoeuvre is found by: L-BFGS from several starts, compiled as a whole."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..programs import compiled
from ..simulation import prbs
from .design_limits import Bounds

_TOLERANCE = 1e-5

Loss = Callable[[Array, Any], Array]


@compiled
def descend(
    loss: Loss, begin: Float[Array, "b k m"], args: Any, steps: int
) -> tuple[Float[Array, "b k m"], Float[Array, "b steps"]]:
    """Where at most `steps` evaluations of `loss(free, args)` lead from each of `begin`, and the loss after each.

    A start from which the search has ended adds NaN.
    """
    solver = optx.LBFGS(rtol=_TOLERANCE, atol=_TOLERANCE)
    with_nothing = lambda free, args: (loss(free, args), None)

    def search(free: Array) -> tuple[Array, Array]:
        scalar = jax.ShapeDtypeStruct((), free.dtype)
        first: Any = solver.init(with_nothing, free, args, {}, scalar, None, frozenset())
        moving, fixed = eqx.partition(first, eqx.is_array)

        def more(carry: tuple) -> Array:
            count, _, state, _ = carry
            return (count < steps) & ~state.terminate

        def advance(carry: tuple) -> tuple:
            count, free, state, history = carry
            free, state, _ = solver.step(with_nothing, free, args, {}, eqx.combine(state, fixed), frozenset())
            history = history.at[count].set(state.f_info.f)
            return count + 1, free, eqx.filter(state, eqx.is_array), history

        empty = jnp.full(steps, jnp.nan, free.dtype)
        _, free, _, history = jax.lax.while_loop(more, advance, (jnp.asarray(0), free, moving, empty))
        return free, history

    # one after the other: side by side, their sensitivities leave the cache
    return jax.lax.map(search, begin)


def telegraphs(bounds: Bounds, seed: int) -> dict[str, np.ndarray]:
    """Random telegraph signals (K, m) between the limits, of holds from one sample to about half the run, by name.

    The actuators' are independent of each other.
    """
    samples, (low, high) = len(bounds.step), (np.asarray(bounds.low), np.asarray(bounds.high))
    made = {}
    for level in range(int(np.log2(samples))):
        hold, draw = 2**level, 1000 * (100 * seed + level)
        signals = np.stack([prbs(samples, hold, 1.0, draw + i) for i in range(len(low))], 1)
        made[f"telegraph of {hold} samples"] = np.where(signals > 0.0, high, low)
    return made
