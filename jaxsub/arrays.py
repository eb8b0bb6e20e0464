"""Which library does the arithmetic of arrays."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

# for NumPy on what may have diverged, which then is no number, as it is by JAX
quietly = np.errstate(over="ignore", invalid="ignore", divide="ignore", under="ignore")
# arrays of either library
Values = Array | np.ndarray


def namespace(*values: Any) -> Any:
    """`jax.numpy` if any of `values` is an array of JAX's, else `numpy`.

    What is evaluated once on NumPy arrays, such as a candidate effect along a recorded motion, is a handful of
    operations: by JAX each of them would be a program, compiled or read from its cache for longer than it runs.
    """
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def aligned_zeros(shape: tuple[int, ...], dtype: Any = float) -> np.ndarray:
    """Zeros that `jax.device_put` places on a CPU without a copy: 64-byte aligned. They are not to change after it."""
    size, width = math.prod(shape) * np.dtype(dtype).itemsize, 64
    memory = np.zeros(size + width, np.uint8)
    first = -memory.ctypes.data % width
    return memory[first : first + size].view(dtype).reshape(shape)


@quietly
def single(values: np.ndarray) -> np.ndarray:
    """`values` in single precision: infinite beyond it, as of a simulation that diverges."""
    return values.astype(np.float32)
