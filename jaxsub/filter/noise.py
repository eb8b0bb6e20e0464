"""Process-noise rules: how much the state may stray from its model in a sample interval.

A rule is asked once an interval. It sees what became of the last measurement and keeps a memory of its own, so that
constant, random and adaptive noise enter the filters through one door.
"""

import abc
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class Innovation(eqx.Module):
    """What a sample shows that was not expected.

    **Fields**

    - `value`: (c,) measured less expected, SI, zero where missing or rejected; `mask`: (c,) true elsewhere.
    - `C`: (c, q) Jacobian of the outputs by [x, θ]. `R_root`: (c, c) factor of the sensors' covariance, SI.
    - `covariance`: (c, c) of the innovation, SI, as if nothing was missing.
    """

    value: Float[Array, " c"]
    mask: Bool[Array, " c"]
    C: Float[Array, "c q"]
    R_root: Float[Array, "c c"]
    covariance: Float[Array, "c c"]


class Residuals(eqx.Module):
    """What the last measurement did.

    **Fields**

    - `innovation`: (c,) SI, zero where missing or rejected; `mask`: (c,) true where used.
    - `factor`: (c, c) lower-triangular factor of the innovation's covariance.
    - `gain`: (s, c) state by channel, SI; `correction`: (s,) of the state, SI: gain times innovation.
    """

    innovation: Float[Array, " c"]
    mask: Bool[Array, " c"]
    factor: Float[Array, "c c"]
    gain: Float[Array, "s c"]
    correction: Float[Array, " s"]

    @classmethod
    def none(cls, x_root: Float[Array, "s s"], R_root: Float[Array, "c c"]) -> "Residuals":
        """Those before the first measurement of a state of uncertainty `x_root` by channels of noise `R_root`."""
        s, c = len(x_root), len(R_root)
        kind = x_root.dtype
        nothing, none = jnp.zeros(c, kind), jnp.zeros(c, bool)
        return cls(nothing, none, R_root, jnp.zeros((s, c), kind), jnp.zeros(s, kind))


class AbstractNoiseRule(eqx.Module):
    """A process-noise rule; its memory is any pytree of arrays whose shapes do not change."""

    @abc.abstractmethod
    def start(self) -> Any:
        """The memory at the start of a run."""

    @abc.abstractmethod
    def __call__(self, memory: Any, residuals: Residuals, elapsed: Float[Array, ""]) -> tuple[Any, Float[Array, "s m"]]:
        """The memory, and a square root of the covariance that the state gathers in the next `elapsed` seconds."""

    def surprise(self, memory: Any, seen: Innovation) -> tuple[Any, Float[Array, "s m"]] | None:
        """The memory, and a root of what the state must have gathered besides, now that `seen` is known.

        Asked after every sample, before it corrects the state; by default a rule learns only afterwards.
        """
        return None


class ConstantNoise(AbstractNoiseRule):
    """White noise: a square root that grows with the root of the time elapsed.

    **Fields**

    - `density`: (s, m) square root of the spectral density, state units per root second.
    """

    density: Float[Array, "s m"]

    def start(self) -> tuple[()]:
        """Nothing to remember."""
        return ()

    def __call__(
        self, memory: tuple[()], residuals: Residuals, elapsed: Float[Array, ""]
    ) -> tuple[tuple[()], Float[Array, "s m"]]:
        """The density over the time elapsed."""
        return memory, self.density * jnp.sqrt(elapsed)
