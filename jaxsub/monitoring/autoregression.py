"""Autoregressions of a filter's whitened innovations, from which further ones are drawn."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key
from scipy import linalg

# the highest order that is tried
_HIGHEST = 20
# standard deviation of the Gaussian number added to what is drawn, in its own: without it no draw exceeds the data's
_SMOOTHING = 0.5


class Autoregression(eqx.Module):
    r"""$e_k = \sum_l a_l e_{k-l} + u_k$ in each channel, with vectors u drawn from those of the data.

    **Fields**

    - `coefficients`: (p, c). `drawn`: (N, c) what they leave, from which u is drawn; none where u is Gaussian.

    Source: Bühlmann (1997), Bernoulli 3; Silverman and Young (1987), Biometrika 74, for smoothed draws.
    """

    coefficients: Float[Array, "p c"]
    drawn: Float[Array, "n c"] | None

    @classmethod
    def white(cls, channels: int) -> "Autoregression":
        """Gaussian vectors of unit variance, independent over time."""
        return cls(jnp.zeros((1, channels)), None)

    @classmethod
    def of(cls, series: Float[np.ndarray, "k c"]) -> "Autoregression":
        """By Yule and Walker, each channel of the `series` (K, c) of the order of least information criterion."""
        found = [_by_yule_walker(channel) for channel in series.T]
        order = max(1, *(len(own) for own in found))
        coefficients = np.stack([np.pad(own, (0, order - len(own))) for own in found], axis=1)
        past = np.stack([series[order - lag : len(series) - lag] for lag in range(1, order + 1)])
        left = series[order:] - np.sum(coefficients[:, None] * past, axis=0)
        return cls(jnp.asarray(coefficients), jnp.asarray(left))

    def start(self, series: int) -> Float[Array, "p b c"]:
        """The past of so many series, before the first sample."""
        return jnp.zeros((self.coefficients.shape[0], series, self.coefficients.shape[1]))

    def next(
        self, past: Float[Array, "p b c"], key: Key[Array, ""]
    ) -> tuple[Float[Array, "p b c"], Float[Array, "b c"]]:
        """The `past` (p, b, c) and a further sample of each series, by the random `key`."""
        series, channels = past.shape[1:]
        gaussian = jax.random.normal(key, (series, channels))
        if self.drawn is None:
            fresh = gaussian
        else:
            chosen = jax.random.randint(jax.random.fold_in(key, 1), (series,), 0, len(self.drawn))
            spread = _SMOOTHING * jnp.std(self.drawn, axis=0)
            # the variance stays that of the data
            fresh = (self.drawn[chosen] + spread * gaussian) / jnp.sqrt(1.0 + _SMOOTHING**2)
        e = fresh + jnp.sum(self.coefficients[:, None] * past, axis=0)
        return jnp.concatenate([e[None], past[:-1]]), e


def _by_yule_walker(series: Float[np.ndarray, " k"]) -> Float[np.ndarray, " p"]:
    """Coefficients of the order of least Bayesian information criterion, empty where the series is white."""
    count = len(series)
    highest = min(_HIGHEST, count // 10)
    gamma = np.array([series[lag:] @ series[: count - lag] for lag in range(highest + 1)]) / count
    if not gamma[0] > 0.0:
        return np.zeros(0)
    best, found = count * np.log(gamma[0]), np.zeros(0)
    for order in range(1, highest + 1):
        coefficients = linalg.solve_toeplitz(gamma[:order], gamma[1 : order + 1])
        left = gamma[0] - coefficients @ gamma[1 : order + 1]
        criterion = count * np.log(max(left, 1e-300)) + order * np.log(count)
        if criterion < best:
            best, found = criterion, coefficients
    return found
