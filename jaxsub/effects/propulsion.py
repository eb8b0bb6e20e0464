"""Propulsion effects: what a propeller does besides pushing."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractForce, amplitude
from .motion import Facts, Motion, Signal


class PropellerTorque(AbstractForce):
    r"""Roll reaction of the propeller: $K = K_{nn}|n|n$ with recorded shaft speed, else a constant $K_Q$.

    At constant rpm this cannot be told from a trim offset or an asymmetric hull. Source: Fossen (2021), §9.5.
    """

    name: ClassVar[str] = "propeller-torque"
    family: ClassVar[str] = "propulsion"
    grows_with: str = eqx.field(static=True)
    torque: Array = amplitude("N*m")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PropellerTorque]":
        """One, for a submerged body free in roll."""
        if facts.kind != "submerged-body" or "roll" not in facts.equations:
            return []
        source = [name for name in ("shaft_speed", "thrust") if name in facts.actuators]
        return [cls(source[0] if source else "constant")]

    @property
    def where(self) -> tuple[str, ...]:
        """Roll."""
        return ("roll",)

    @property
    def expression(self) -> str:
        """The torque."""
        return {"shaft_speed": "K_Q |n| n", "thrust": "K_Q T", "constant": "K_Q"}[self.grows_with]

    def symbols(self) -> dict[str, str]:
        """`K_Q`."""
        return {"torque": "K_Q"}

    def units(self) -> dict[str, str]:
        """A moment, per what it grows with."""
        return {"torque": {"shaft_speed": "N*m/(rad/s)/(rad/s)", "thrust": "m", "constant": "N*m"}[self.grows_with]}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The reaction along the motion."""
        if self.grows_with == "shaft_speed":
            n = motion.actuators["shaft_speed"]
            return {"roll": self.torque * abs(n) * n}
        if self.grows_with == "thrust":
            return {"roll": self.torque * motion.actuators["thrust"]}
        return {"roll": self.torque + 0.0 * motion.rates["roll"]}
