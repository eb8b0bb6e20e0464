"""Whether a series is white, and how much of it its past predicts."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import linalg, special

# samples; each window is a test of its own
_LAGS = (5, 20, 60)
# samples from which the next is predicted
_PAST = 20


def portmanteau(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> float:
    """The least of the channels' p-values (`portmanteau_by_channel`), corrected for the number of channels."""
    least = portmanteau_by_channel(white, measured)
    return min(1.0, float(np.min(least, initial=1.0)) * len(least))


def portmanteau_by_channel(
    white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]
) -> Float[np.ndarray, " c"]:
    r"""p-value of correlations over time as large as those of each channel of `white`, under independence.

    $Q = \sum_{l\le L} (\sum_k e_k e_{k+l})^2 / \sum_k e_k^2 e_{k+l}^2$ is $\chi^2_L$ for innovations, whatever their
    variance; the least p-value over windows L, corrected for their number; 1 where there are too few samples.
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
    return np.minimum(1.0, np.min(least, axis=0) * len(windows)) if windows else np.ones(seen.shape[2])


def remembered(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> float:
    r"""By how much χ² would fall if each innovation were predicted from the last P of its channel, less chance's share.

    $\sum_c \max(0,\ N \ln(\gamma_0/\sigma^2) - P)$, σ² what an autoregression by the covariances γ leaves.
    """
    share, count = predicted_share(white, measured), measured.sum(axis=(0, 1))
    past = min(_PAST, white.shape[1] // 4)
    return float(np.sum(np.maximum(0.0, -count * np.log1p(-share) - past), where=share > 0.0))


def predicted_share(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> Float[np.ndarray, " c"]:
    r"""The share $1 - \sigma^2/\gamma_0$ of each channel's variance that its last P samples predict.

    Source: Yule and Walker; Box and Jenkins (1976), Time Series Analysis.
    """
    seen, past = np.where(measured, white, 0.0), min(_PAST, white.shape[1] // 4)
    gamma = np.stack([np.sum(seen[:, lag:] * seen[:, : seen.shape[1] - lag], axis=(0, 1)) for lag in range(past + 1)])
    share = np.zeros(seen.shape[2])
    for channel, own in enumerate(gamma.T):
        if past and own[0] > 0.0:
            left = own[0] - own[1:] @ linalg.solve_toeplitz(own[:-1], own[1:])
            share[channel] = 1.0 - max(left / own[0], 1e-15)
    return share
