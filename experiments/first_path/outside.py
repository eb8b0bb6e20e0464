"""Forces that no effect of the vocabulary has, each a user's own small class."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from jaxsub.effects import AbstractForce, Facts, Motion
from jaxsub.effects.base import amplitude
from jaxsub.parameters import number


class HeadingForce(AbstractForce):
    """A moment that depends on the heading, such as a magnetic or a mooring moment: τ = a sin(n ψ + φ₀)."""

    name: ClassVar[str] = "heading-force"
    family: ClassVar[str] = "outside"
    equation: str = eqx.field(static=True)
    harmonic: float = eqx.field(static=True)
    size: Array = amplitude("N*m")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[HeadingForce]":
        """None: this is what the vocabulary lacks."""
        return []

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The moment."""
        return f"a sin({self.harmonic:g} ψ)"

    def force(self, motion: Motion) -> dict[str, Array]:
        """The moment along the motion."""
        return {self.equation: self.size * jnp.sin(self.harmonic * motion.positions["psi"] + 0.5)}


class DepthForce(AbstractForce):
    """A force that comes and goes with depth, such as layers of different density: τ = a sin(k z)."""

    name: ClassVar[str] = "layer-force"
    family: ClassVar[str] = "outside"
    equation: str = eqx.field(static=True)
    wavenumber: float = eqx.field(static=True)
    size: Array = amplitude("N")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[DepthForce]":
        """None: this is what the vocabulary lacks."""
        return []

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The force."""
        return f"a sin({self.wavenumber:g} z)"

    def force(self, motion: Motion) -> dict[str, Array]:
        """The force along the motion."""
        return {self.equation: self.size * jnp.sin(self.wavenumber * motion.positions["z"])}


OUTSIDE = (
    HeadingForce("yaw", 4.0, number(60.0)),
    HeadingForce("sway", 6.0, number(60.0)),
    HeadingForce("roll", 3.0, number(40.0)),
    DepthForce("heave", 2.5, number(25.0)),
    DepthForce("pitch", 3.0, number(25.0)),
)
