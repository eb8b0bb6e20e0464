r"""A number that differs by run, as a random effect about what the other columns explain of whitened innovations.

With W the products (R, R) of the number's column cut to each of R runs, less what the other columns take up, and w
theirs with the residual, the deviations $\Delta\sim N(0, s^2)$ gain the log restricted likelihood

$g(s) = \tfrac12\sum_i\left(\frac{u_i^2s^2}{1+\lambda_is^2} - \ln(1+\lambda_is^2)\right),\quad
W = U\,\mathrm{diag}(\lambda)\,U^T,\; u = U^Tw$.

Where the runs do not differ, $\sum_iu_i^2/\lambda_i$ is $\chi^2$ of R - 1 degrees of freedom: the mean takes up one.
This test is exact for any R, while the likelihood ratio, with s = 0 on its bound, is not for few runs.
Sources: Wald (1947), Ann. Math. Statist. 18; Crainiceanu and Ruppert (2004), J. R. Stat. Soc. B 66.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .. import settings

# standard deviations that are tried at first, of the largest that may be most probable, and then about the best
_LEAST, _TRIED = 1e-5, 60


class RunEffect(NamedTuple):
    """The most probable standard deviation between runs, what it gains of the log likelihood, and the χ² without it."""

    spread: float
    gain: float
    statistic: float

    @classmethod
    def of(cls, W: Float[np.ndarray, "r r"], w: Float[np.ndarray, " r"]) -> "RunEffect":
        """By the products W and w."""
        values, U = np.linalg.eigh(0.5 * (W + W.T))
        values, u = np.maximum(values, 0.0), U.T @ w
        # the smallest is of the mean
        kept = (values > settings.IDENTIFIABLE_SHARE * values[-1]) & (np.arange(len(values)) > 0)
        statistic = float(np.sum(u[kept] ** 2 / values[kept]))
        # each direction alone would have the square of it so large
        most = float(np.max((u[kept] / values[kept]) ** 2, initial=0.0))
        if most == 0.0:
            return cls(0.0, 0.0, statistic)

        def gains(spreads: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
            scaled = spreads[:, None] ** 2
            return 0.5 * np.sum(scaled * u**2 / (1.0 + scaled * values) - np.log1p(scaled * values), axis=1)

        tried = np.sqrt(most) * np.geomspace(_LEAST, 1.0, _TRIED)
        best = int(np.argmax(gains(tried)))
        near = np.geomspace(tried[max(best - 1, 0)], tried[min(best + 1, _TRIED - 1)], _TRIED)
        found = gains(near)
        best = int(np.argmax(found))
        return cls(float(near[best]), float(found[best]), statistic) if found[best] > 0.0 else cls(0.0, 0.0, statistic)
