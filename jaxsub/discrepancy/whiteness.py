"""Is anything left in the residuals? A portmanteau test that asks for no alternative."""

import numpy as np
from jaxtyping import Float
from scipy import special

from ..estimate import Fit

_LAGS = 10


def whiteness_p_value(fit: Fit) -> float:
    r"""The probability that white residuals look as correlated as these, corrected for channels and both forms tried.

    Under whiteness $\sqrt N\rho_l$ is standard normal and independent between lags (Bartlett 1946), so $\sqrt N\rho_1$
    finds what is fast and $\sum_{l\le10}\sqrt{N/10}\,\rho_l$ what is slow. One-sided: left-out physics correlates.
    """
    residual, mask = np.asarray(fit.residual), np.asarray(fit.runs.mask)
    least = 1.0
    for channel in range(residual.shape[-1]):
        z = _scaled_correlations(residual[..., channel], mask[..., channel])
        least = min(least, float(special.ndtr(-z[0])), float(special.ndtr(-z.sum() / np.sqrt(_LAGS))))
    return min(1.0, 2.0 * residual.shape[-1] * least)


def _scaled_correlations(r: Float[np.ndarray, "r k"], mask: np.ndarray) -> Float[np.ndarray, " l"]:
    """√N ρ_l for l = 1 … 10 over the pairs of samples that both exist."""
    power = np.sum(r**2) / max(mask.sum(), 1)
    values = []
    for lag in range(1, _LAGS + 1):
        pairs = np.sum(mask[:, lag:] & mask[:, :-lag])
        values.append(np.sum(r[:, lag:] * r[:, :-lag]) / max(power, 1e-300) / np.sqrt(max(pairs, 1)))
    return np.array(values)
