"""A force that follows one variable smoothly: what is left to say where nothing in the vocabulary fits."""

import functools
import math
import operator
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..arrays import namespace
from ..errors import InputError
from .base import AbstractForce, amplitude, edge
from .motion import FORCES, Facts, Motion, Signal, by_name, unit_per

KNOTS = 12


class SmoothForce(AbstractForce):
    r"""A force that is a piecewise line in one variable: $\tau_i = \sum_j a_j\,\Lambda_j(x)$.

    $\Lambda_j$ are linear B-splines at `KNOTS` equidistant places, `low` to `high`; beyond them the force is that at
    the end. It describes and does not explain: it is no candidate, and joins a model whose mismatch has no name. Each
    a_j is Gaussian about zero before the data, of standard deviation `spread`, N or N m: so what a coefficient can do,
    such as damping what a line through the knots can, is left to it.
    """

    name: ClassVar[str] = "smooth-force"
    family: ClassVar[str] = "description"
    equation: str = eqx.field(static=True)
    variable: str = eqx.field(static=True)
    low: float = edge()
    high: float = edge()
    spread: float = eqx.field(static=True, default=math.inf)
    a_0: Array = amplitude("1")
    a_1: Array = amplitude("1")
    a_2: Array = amplitude("1")
    a_3: Array = amplitude("1")
    a_4: Array = amplitude("1")
    a_5: Array = amplitude("1")
    a_6: Array = amplitude("1")
    a_7: Array = amplitude("1")
    a_8: Array = amplitude("1")
    a_9: Array = amplitude("1")
    a_10: Array = amplitude("1")
    a_11: Array = amplitude("1")

    def __check_init__(self):
        if not self.low < self.high:
            raise InputError(
                self.label, f"its low {self.low:g} is not below its high {self.high:g}", "mend one of them"
            )

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SmoothForce]":
        """None: it is not a name for anything."""
        return []

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    def units(self) -> dict[str, str]:
        """A force or a moment."""
        return dict.fromkeys((f"a_{j}" for j in range(KNOTS)), unit_per(self.equation))

    def prior_std(self) -> dict[str, float]:
        """The same for all."""
        return dict.fromkeys(self.units(), self.spread)

    @property
    def expression(self) -> str:
        """That it depends on the variable."""
        return f"{FORCES.get(self.equation, 'F')}({self.variable}), by interpolation"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The force along the motion."""
        x = variables(motion)[self.variable]
        xp = namespace(x, self.a_0)
        place = xp.clip((x - self.low) / (self.high - self.low), 0.0, 1.0) * (KNOTS - 1)
        parts = [getattr(self, f"a_{j}") * xp.maximum(0.0, 1.0 - abs(place - j)) for j in range(KNOTS)]
        return {self.equation: functools.reduce(operator.add, parts)}


def variables(motion: Motion) -> dict[str, Signal]:
    """What of `motion` a force may follow, by its name in files: velocities, positions, actuators, surroundings.

    A heading is taken within a turn, (-π, π].
    """
    found = by_name(motion)
    if "psi" in found:
        xp = namespace(found["psi"])
        found["psi"] = xp.arctan2(xp.sin(found["psi"]), xp.cos(found["psi"]))
    return found
