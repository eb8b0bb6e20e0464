"""Effects of mechanisms: dry friction and springs that stiffen."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from .base import AbstractForce, amplitude
from .motion import Facts, Motion, Signal


class CoulombFriction(AbstractForce):
    r"""Dry friction with an offset: $F = -F_c \tanh(\dot q / \dot q_s) - F_0$, $F_c \ge 0$.

    $\dot q_s$, a fiftieth of the rms rate, smooths the sign function so that the force has a derivative; $F_0$ is the
    offset of a drive that needs more force one way than the other.
    Source: Olsson et al. (1998); Janot et al. (2019), EMPS.
    """

    name: ClassVar[str] = "coulomb-friction"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    smoothing: float = eqx.field(static=True)
    F_c: Array = amplitude("1", sign=+1)
    F_0: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[CoulombFriction]":
        """One for each coordinate of a mechanism."""
        if facts.kind != "mechanism":
            return []
        return [cls(e, float(f"{facts.rate_scale[e] / 50.0:.3g}")) for e in facts.equations]

    @property
    def where(self) -> tuple[str, ...]:
        """The one coordinate."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """Friction and offset."""
        return f"-F_c sign({self.equation}') - F_0"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The friction along the motion."""
        return {self.equation: -self.F_c * jnp.tanh(motion.rates[self.equation] / self.smoothing) - self.F_0}


class CubicStiffness(AbstractForce):
    r"""A spring that stiffens or softens: $F = -k_3 q^3$, of either sign.

    Source: Duffing (1918); Silverbox benchmark.
    """

    name: ClassVar[str] = "cubic-stiffness"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    k_3: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[CubicStiffness]":
        """One for each coordinate of a mechanism."""
        return [cls(e) for e in facts.equations] if facts.kind == "mechanism" else []

    @property
    def where(self) -> tuple[str, ...]:
        """The one coordinate."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The restoring force."""
        return f"-k_3 {self.equation}³"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The restoring force along the motion."""
        return {self.equation: -self.k_3 * motion.positions[self.equation] ** 3}
