"""Hull damping beyond the linear: drag on one equation that grows with a power of its own velocity."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractDerivative, amplitude
from .derivatives import Derivative, Power
from .motion import FORCES, VELOCITIES, Facts


class _PowerDamping(AbstractDerivative):
    """Drag on one equation that grows with a power of its own velocity."""

    equation: eqx.AbstractVar[str]
    coefficient: eqx.AbstractVar[Array]
    power: eqx.AbstractClassVar[int]

    @classmethod
    def candidates(cls, facts: Facts) -> Sequence["_PowerDamping"]:
        """One for each free equation."""
        return [cls(equation) for equation in facts.equations]  # pyright: ignore[reportCallIssue]

    @property
    def derivative(self) -> Derivative:
        """The equation's own velocity to the power, with its sign."""
        return Derivative(self.equation, (Power(self.equation, self.power),))

    @property
    def replaces(self) -> tuple[str, ...]:
        """Linear damping of the same velocity."""
        body = self.equation in VELOCITIES
        return (f"{FORCES[self.equation]}_{VELOCITIES[self.equation]}" if body else f"D_{self.equation}",)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `K_pp`, `K_ppp`; `D2_roll`, `D3_roll` for a mechanism's coordinate."""
        if self.equation in VELOCITIES:
            return {"coefficient": f"{FORCES[self.equation]}_{VELOCITIES[self.equation] * self.power}"}
        return {"coefficient": f"D{self.power}_{self.equation}"}


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
