"""The white part of residuals, and how much of the innovations is predicted by their past."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...likelihood.whiteness import portmanteau, remembered
from .. import settings


class Memory(NamedTuple):
    """Whether innovations are random.

    **Fields**

    - `p_value`: how probable they are to be so correlated over time by chance.
    - `explained`: the share that some effects have in what they explain and what the innovations' past would.
    - `gain`: the χ² that the past explains.
    """

    p_value: float
    explained: float
    gain: float = 0.0

    @property
    def correlated(self) -> bool:
        """Whether they are not."""
        return self.p_value < settings.RESIDUAL_LEVEL


def memory(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"], gain: float) -> Memory:
    """Of innovations that are left beside effects which `gain` so much χ²."""
    past = remembered(white, measured)
    return Memory(portmanteau(white, measured), share_of(gain, past), past)


def share_of(gain: float, past: float) -> float:
    """The effects' share of the χ² that they `gain` and that the `past` of the innovations explains."""
    return max(gain, 0.0) / max(gain + past, 1e-300)


def record_sigma(error: Float[np.ndarray, "r k c"], mask: np.ndarray) -> Float[np.ndarray, " c"]:
    r"""The white part of each channel's residual $\sqrt{\tfrac12\langle(e_{k+1}-e_k)^2\rangle}$, SI (von Neumann)."""
    both = mask[:, 1:] & mask[:, :-1]
    squares = np.sum(np.where(both, np.diff(error, axis=1), 0.0) ** 2, axis=(0, 1))
    return np.sqrt(0.5 * squares / np.maximum(both.sum((0, 1)), 1))
