"""Functions of one variable that a vehicle file gives as a polynomial or a table."""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np

from ...arrays import Values
from ...effects import Signal
from .keys import Curve


def evaluated(key: str, points: Curve | None, numbers: Mapping[str, Values], at: Signal) -> Signal:
    """The function of `key` at `at`: between `points`, level beyond them, or of the coefficients `key_0` … in order."""
    if points is not None:
        x, y = (jnp.asarray(np.array(values), jnp.result_type(float)) for values in points)
        return jnp.interp(at, x, y)
    coefficients = [numbers[f"{key}_{power}"] for power in range(order(key, numbers))]
    total = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = total * at + coefficient
    return total + 0.0 * at


def order(key: str, numbers: Mapping[str, object]) -> int:
    """How many coefficients the polynomial of `key` has, 0 where there is none."""
    count = 0
    while f"{key}_{count}" in numbers:
        count += 1
    return count
