r"""Process noise from fuzzy regression on the state's residuals (the second paper's section 4).

$\Delta x$ is what a measurement corrects the state by; over a moving window it is fitted by Tanaka's line
$\Delta x(t) = A_0 + A_1 t$ with fuzzy $A_i$, whose slope is $\Delta\dot x$. Then
$Q_{ii} = |\Delta x_i\,\Delta\dot x_i|\,\Delta t$, which is read here as a density $|\Delta x_i\,\Delta\dot x_i|$
over the time $\Delta t$ that passes.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .noise import AbstractNoiseRule, Residuals
from .regression import fuzzy_line
from .rules import Window


class FuzzyNoise(AbstractNoiseRule):
    r"""Equation 18: $Q_{ii} = |\Delta x_i\,\Delta\dot x_i|\,\Delta t$.

    **Fields**

    - `least`, `most`: (s,) root of the limits of the density, state units per root second. Without a least one Q feeds
      on corrections that it has itself made small.
    - `level`: h of the regression. `width`: measurements in the window.
    """

    least: Float[Array, " s"]
    most: Float[Array, " s"]
    level: float = 0.0
    width: int = eqx.field(static=True, default=10)

    def start(self) -> tuple[Window, Float[Array, " s"]]:
        """An empty window, and the least density."""
        return Window.start(self.width, self.least), self.least**2

    def __call__(
        self, memory: tuple[Window, Float[Array, " s"]], residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[tuple[Window, Float[Array, " s"]], Float[Array, "s s"]]:
        """The density of the last measurement's window over the time elapsed."""
        window, density = memory
        fresh = jnp.any(residuals.mask)
        window = window.with_newest(residuals.correction, fresh)
        steep = jnp.abs(residuals.correction * slopes(window, self.level))
        density = jnp.where(fresh, jnp.clip(steep, self.least**2, self.most**2), density)
        return (window.on(elapsed), density), jnp.diag(jnp.sqrt(density) * jnp.sqrt(elapsed))


def slopes(window: Window, level: Float[Array, ""] | float) -> Float[Array, " k"]:
    """(k,) the centre of each fuzzy line's slope over the window, per second."""
    lines = jax.vmap(fuzzy_line, in_axes=(None, 1, None, None))(window.times, window.values, window.held, level)
    return lines.centre[:, 1]
