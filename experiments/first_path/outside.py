"""Forces that no effect of the vocabulary has, through a user's own small class."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxsub.effects import AbstractForce, Facts, Motion
from jaxsub.effects.base import amplitude
from jaxsub.parameters import number


class PeriodicForce(AbstractForce):
    """A force that is periodic in a position: with the heading as a mooring's, with depth as in layers of water.

    τ = a sin(k η + φ₀) for one of the positions η (rad or m).
    """

    name: ClassVar[str] = "periodic-force"
    family: ClassVar[str] = "outside"
    equation: str = eqx.field(static=True)
    position: str = eqx.field(static=True)
    wavenumber: float = eqx.field(static=True)
    phase: float = eqx.field(static=True)
    size: Array = amplitude("N")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PeriodicForce]":
        """None: this is what the vocabulary lacks."""
        return []

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The force."""
        return f"a sin({self.wavenumber:g} {self.position} + {self.phase:g})"

    def force(self, motion: Motion) -> dict[str, Array]:
        """The force along the motion."""
        return {self.equation: self.size * jnp.sin(self.wavenumber * motion.positions[self.position] + self.phase)}


OUTSIDE = (
    PeriodicForce("yaw", "psi", 4.0, 0.5, number(60.0)),
    PeriodicForce("sway", "psi", 6.0, 0.5, number(60.0)),
    PeriodicForce("roll", "psi", 3.0, 0.5, number(40.0)),
    PeriodicForce("heave", "z", 2.5, 0.0, number(25.0)),
    PeriodicForce("pitch", "z", 3.0, 0.0, number(25.0)),
)
