"""Hull damping beyond the linear: drag on one equation that grows with a power of its own velocity."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractForce, amplitude
from .motion import FORCES, VELOCITIES, Facts, Motion, Signal, unit_per


class _PowerDamping(AbstractForce):
    """Drag on one equation that grows with a power of its own velocity."""

    equation: eqx.AbstractVar[str]
    coefficient: eqx.AbstractVar[Array]
    power: eqx.AbstractClassVar[int]

    @classmethod
    def candidates(cls, facts: Facts) -> Sequence["_PowerDamping"]:
        """One for each free equation."""
        return [cls(equation) for equation in facts.equations]  # pyright: ignore[reportCallIssue]

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def expression(self) -> str:
        """The drag term."""
        velocity = VELOCITIES.get(self.equation, f"{self.equation}'")
        growth = {2: f"|{velocity}| {velocity}", 3: f"{velocity}³"}[self.power]
        return f"{self.symbols()['coefficient']} {growth}"

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `K_pp`, `K_ppp`; `D2_roll`, `D3_roll` for a mechanism's coordinate."""
        if self.equation in VELOCITIES:
            return {"coefficient": f"{FORCES[self.equation]}_{VELOCITIES[self.equation] * self.power}"}
        return {"coefficient": f"D{self.power}_{self.equation}"}

    def units(self) -> dict[str, str]:
        """Force per power of the velocity."""
        return {"coefficient": unit_per(self.equation, *(self.equation,) * self.power)}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The drag along the motion."""
        rate = motion.rates[self.equation]
        return {self.equation: self.coefficient * abs(rate) ** (self.power - 1) * rate}


class QuadraticDamping(_PowerDamping):
    r"""Drag that grows with the square of one velocity: $\tau_i = c\,|\nu_i|\nu_i$, with $c \le 0$.

    Source: Fossen, Handbook of Marine Craft Hydrodynamics (2021), §6.4.
    """

    name: ClassVar[str] = "quadratic-damping"
    family: ClassVar[str] = "hull"
    power: ClassVar[int] = 2
    equation: str = eqx.field(static=True)
    coefficient: Array = amplitude("1", sign=-1)


class CubicDamping(_PowerDamping):
    r"""Drag that grows with the cube of one velocity: $\tau_i = c\,\nu_i^3$, with $c \le 0$.

    Source: ITTC 7.5-02-07-04.5 for roll; Abkowitz (1964) for the other equations.
    """

    name: ClassVar[str] = "cubic-damping"
    family: ClassVar[str] = "hull"
    power: ClassVar[int] = 3
    equation: str = eqx.field(static=True)
    coefficient: Array = amplitude("1", sign=-1)
