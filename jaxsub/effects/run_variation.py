"""A number of the vehicle that differs from run to run."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractEffect, amplitude
from .motion import Facts


class RunVariation(AbstractEffect):
    r"""A number that differs by run: $\theta_r = \bar\theta + \Delta_r$, $\Delta_r\sim N(0, s^2)$, s the `spread`.

    The mean is the number itself, of SI unit `unit`; `places` are the equations and sensors that feel it. It is no
    force of its own: a vehicle has it as `varies = "run"` of that number, and $\Delta_r$ as a state that stands still.
    Source: Laird and Ware (1982), Biometrics 38(4).
    """

    name: ClassVar[str] = "run-variation"
    family: ClassVar[str] = "runs"
    number: str = eqx.field(static=True)
    unit: str = eqx.field(static=True, default="")
    places: tuple[str, ...] = eqx.field(static=True, default=())
    spread: Array = amplitude("1", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[RunVariation]":
        """Each number of which there are runs enough to tell."""
        return [cls(*one) for one in facts.varying]

    @property
    def label(self) -> str:
        """With the number that differs."""
        return f"{self.name}[{self.number}]"

    @property
    def where(self) -> tuple[str, ...]:
        """What feels the number."""
        return self.places

    @property
    def expression(self) -> str:
        """That it differs."""
        return f"{self.number} + deviation of the run, standard deviation spread"

    def units(self) -> dict[str, str]:
        """That of the number."""
        return {"spread": self.unit}
