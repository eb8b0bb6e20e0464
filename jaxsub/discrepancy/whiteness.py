"""The white part of residuals, whether innovations are white, and how much of them their past tells."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy import linalg, special

# samples; each window is a test of its own
_LAGS = (5, 20, 60)
# samples from which the next is predicted
_PAST = 20
# probability below which innovations are not white
_NOT_WHITE = 1e-3


class Memory(NamedTuple):
    """Whether innovations are random.

    **Fields**

    - `p_value`: how probable they are to be so correlated over time by chance.
    - `explained`: the share that some effects have in what they explain and what the innovations' past would.
    - `told`: how much χ² that past would explain.
    """

    p_value: float
    explained: float
    told: float = 0.0

    @property
    def correlated(self) -> bool:
        """Whether they are not."""
        return self.p_value < _NOT_WHITE


RANDOM = Memory(1.0, 1.0)


def memory(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"], gain: float) -> Memory:
    """Of innovations that are left beside effects which `gain` so much χ²."""
    told = remembered(white, measured)
    return Memory(portmanteau(white, measured), share_of(gain, told), told)


def share_of(gain: float, told: float) -> float:
    """Of what effects `gain` and what is `told` beside them, both χ², the effects' share."""
    return max(gain, 0.0) / max(gain + told, 1e-300)


def record_sigma(error: Float[np.ndarray, "r k c"], mask: np.ndarray) -> Float[np.ndarray, " c"]:
    r"""The white part of each channel's residual $\sqrt{\tfrac12\langle(e_{k+1}-e_k)^2\rangle}$, SI (von Neumann)."""
    both = mask[:, 1:] & mask[:, :-1]
    squares = np.sum(np.where(both, np.diff(error, axis=1), 0.0) ** 2, axis=(0, 1))
    return np.sqrt(0.5 * squares / np.maximum(both.sum((0, 1)), 1))


def portmanteau(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> float:
    r"""How probable correlations over time as large as those of `white` are where there are none.

    $Q = \sum_{l\le L} (\sum_k e_k e_{k+l})^2 / \sum_k e_k^2 e_{k+l}^2$ is $\chi^2_L$ for each channel of innovations,
    whatever their variance; the least over channels and windows L, corrected for their number.
    Source: Ljung and Box (1978), Biometrika 65; with the weights of Diebold (1986).
    """
    seen = np.where(measured, white, 0.0)
    longest = min(_LAGS[-1], seen.shape[1] // 4)
    terms = np.zeros((longest, seen.shape[2]))
    for lag in range(1, longest + 1):
        product = seen[:, lag:] * seen[:, :-lag]
        terms[lag - 1] = np.sum(product, axis=(0, 1)) ** 2 / np.maximum(np.sum(product**2, axis=(0, 1)), 1e-300)
    windows = [lags for lags in _LAGS if lags <= longest]
    least = [special.chdtrc(lags, terms[:lags].sum(axis=0)) for lags in windows]
    return min(1.0, float(np.min(least)) * len(windows) * seen.shape[2]) if windows else 1.0


def remembered(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> float:
    r"""By how much χ² would fall if each innovation were predicted from the last P of its channel, less chance's share.

    $\sum_c \max(0,\ N \ln(\gamma_0/\sigma^2) - P)$, σ² what an autoregression by the covariances γ leaves.
    Source: Yule and Walker; Box and Jenkins (1976), Time Series Analysis.
    """
    seen, past = np.where(measured, white, 0.0), min(_PAST, white.shape[1] // 4)
    gamma = np.stack([np.sum(seen[:, lag:] * seen[:, : seen.shape[1] - lag], axis=(0, 1)) for lag in range(past + 1)])
    falls = [0.0]
    for own, count in zip(gamma.T, measured.sum(axis=(0, 1)), strict=True):
        if past and own[0] > 0.0:
            left = own[0] - own[1:] @ linalg.solve_toeplitz(own[:-1], own[1:])
            falls.append(max(0.0, float(count * np.log(own[0] / max(left, 1e-300)) - past)))
    return float(np.sum(falls))
