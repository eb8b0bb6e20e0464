"""The white part of residuals."""

import numpy as np
from jaxtyping import Float


def record_sigma(error: Float[np.ndarray, "r k c"], mask: np.ndarray) -> Float[np.ndarray, " c"]:
    r"""The white part of each channel's residual $\sqrt{\tfrac12\langle(e_{k+1}-e_k)^2\rangle}$, SI (von Neumann)."""
    both = mask[:, 1:] & mask[:, :-1]
    squares = np.sum(np.where(both, np.diff(error, axis=1), 0.0) ** 2, axis=(0, 1))
    return np.sqrt(0.5 * squares / np.maximum(both.sum((0, 1)), 1))
