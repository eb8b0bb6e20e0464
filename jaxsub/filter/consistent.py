r"""A fuzzy rule that keeps its filter consistent.

The paper's rule takes Δx for what a measurement corrected. That is small where the gain is small, so a filter that has
become sure of itself makes itself surer; it is never zero, so noise feeds noise; and it comes after the correction, by
when a jump of one state has been put down to another, such as a gyro's bias. Here

1. Δx is the least disturbance that explains the innovation ν, in terms of the noise W that the sensors' physics gives:
   $\Delta x = M\nu,\ M = WC^T(CWC^T + \epsilon S)^{-1}$, whatever the gain;
2. what the innovation's covariance S explains by itself is taken off: `widths` times $(MSM^T)_{ii}^{1/2}$;
3. what is left enters eq. 18 with its fuzzy slope, and the state is widened by it before it is corrected;
4. elsewhere the noise is λW, and λ follows the normalised innovation squared,
   $\ln\lambda \leftarrow \ln\lambda + \gamma(\eta - E\eta)$ with $\eta = \min(\nu^TS^{-1}\nu/c,\ 3)$ of c channels, so
   that one jump moves it little: it rests where innovations are as large as S says.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import gammainc

from .fuzzy import slopes
from .noise import AbstractNoiseRule, Innovation, Residuals
from .rules import Window
from .small import backward, cholesky, forward, times

# ε: so little of S that it matters only for channels that no disturbance moves
_REST = 1e-6
# one innovation, however large, says no more of λ than this many times a usual one: jumps are the fuzzy term's
_MOST_NIS = 3.0


class Consistency(eqx.Module):
    """The memory of `ConsistentFuzzyNoise`.

    **Fields**

    - `window`: of what no noise explains. `log_scale`: ln λ.
    """

    window: Window
    log_scale: Float[Array, ""]


class ConsistentFuzzyNoise(AbstractNoiseRule):
    r"""$Q_{ii} = (\lambda W_{ii} + |\Delta x_i\,\Delta\dot x_i|)\,\Delta t$ with the module's Δx and λ.

    **Fields**

    - `density`: (s,) root of W, state units per root second: what is known of the process's noise.
    - `widths`: standard deviations that an innovation may explain by itself.
    - `speed`: γ; zero keeps λ at one. `limit`: λ stays between its inverse and it.
    - `level`: h of the regression. `width`: measurements in the window.
    """

    density: Float[Array, " s"]
    widths: float = 3.0
    speed: float = 0.03
    limit: float = 100.0
    level: float = 0.0
    width: int = eqx.field(static=True, default=5)

    def start(self) -> Consistency:
        """λ = 1."""
        return Consistency(Window.start(self.width, self.density), jnp.zeros((), self.density.dtype))

    def __call__(
        self, memory: Consistency, residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[Consistency, Float[Array, "s s"]]:
        """λW over the time elapsed."""
        root = self.density * jnp.sqrt(jnp.exp(memory.log_scale) * elapsed)
        return Consistency(memory.window.on(elapsed), memory.log_scale), jnp.diag(root)

    def surprise(self, memory: Consistency, seen: Innovation) -> tuple[Consistency, Float[Array, "s s"]]:
        """Equation 18 with what the innovation leaves unexplained, over the time since the measurement before."""
        fresh = jnp.any(seen.mask)
        both = seen.mask[:, None] & seen.mask[None, :]
        S = jnp.where(both, seen.covariance, jnp.eye(len(both), dtype=seen.covariance.dtype))
        beyond = self._beyond(seen, S)
        since = memory.window.now - jnp.max(memory.window.times)
        window = memory.window.with_newest(beyond, fresh)
        jump = jnp.where(fresh, jnp.abs(beyond * slopes(window, self.level)) * since, 0.0)
        whitened, count = forward(cholesky(S), seen.value[:, None]), jnp.maximum(jnp.sum(seen.mask), 1)
        nis = jnp.minimum(jnp.sum(whitened**2) / count, _MOST_NIS)
        surplus = nis - jnp.asarray(_expected(len(S)), nis.dtype)[count]
        moved = memory.log_scale + jnp.where(fresh, self.speed * surplus, 0.0)
        log_scale = jnp.clip(moved, -jnp.log(self.limit), jnp.log(self.limit))
        return Consistency(window, log_scale), jnp.diag(jnp.sqrt(jump))

    def _beyond(self, seen: Innovation, S: Float[Array, "c c"]) -> Float[Array, " s"]:
        """(s,) the disturbance that explains the innovation, less what its covariance S does."""
        C = jnp.where(seen.mask[:, None], seen.C[:, : self.density.size], 0.0) * self.density
        L = cholesky(times(C, C.T) + _REST * S)
        M = backward(L, forward(L, C * self.density)).T
        change, own = M @ seen.value, jnp.sqrt(jnp.sum(times(M, S) * M, axis=1))
        return jnp.sign(change) * jnp.maximum(jnp.abs(change) - self.widths * own, 0.0)


def _expected(channels: int) -> np.ndarray:
    """E min(χ²/c, most) of c degrees of freedom, for c up to `channels`."""
    count = np.arange(channels + 1)
    half, most = np.maximum(count, 1) / 2.0, count * _MOST_NIS / 2.0
    return gammainc(half + 1.0, most) + _MOST_NIS * (1.0 - gammainc(half, most))
