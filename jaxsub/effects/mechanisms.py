"""Effects of mechanisms: dry friction, damping that differs by direction, springs that stiffen or level off."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..arrays import namespace
from ..parameters import number
from .base import AbstractForce, amplitude, shape
from .motion import Facts, Motion, Signal

# whose equations have a rate of their own, which friction opposes
_WITH_RATES = ("mechanism", "model")


class AbstractCoordinateForce(AbstractForce):
    """A force in the equation of one coordinate of a mechanism, or of one state of a user's own model."""

    equation: eqx.AbstractVar[str]

    @property
    def where(self) -> tuple[str, ...]:
        """The one coordinate."""
        return (self.equation,)


class CoulombFriction(AbstractCoordinateForce):
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
        """One for each coordinate of a mechanism, or state of a user's own model."""
        if facts.kind not in _WITH_RATES:
            return []
        return [cls(e, float(f"{facts.rate_scale[e] / 50.0:.3g}")) for e in facts.equations]

    @property
    def replaces(self) -> tuple[str, ...]:
        """Viscous friction."""
        return (f"D_{self.equation}",)

    @property
    def expression(self) -> str:
        """Friction and offset."""
        return f"-F_c sign({self.equation}') - F_0"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The friction along the motion."""
        share = motion.rates[self.equation] / self.smoothing
        return {self.equation: -self.F_c * namespace(share).tanh(share) - self.F_0}


class AsymmetricDamping(AbstractCoordinateForce):
    r"""Viscous friction that differs by direction: $F = -D_a |\dot q|$, of either sign.

    Beside the linear damping $D_q$ it is $D_q + D_a$ one way and $D_q - D_a$ the other, and dissipates while
    $|D_a| \le D_q$. Source: Armstrong-Hélouvry, Dupont and Canudas de Wit (1994), Automatica 30, on drives and screws.
    """

    name: ClassVar[str] = "asymmetric-damping"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    D_a: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[AsymmetricDamping]":
        """One for each coordinate of a mechanism, or state of a user's own model."""
        return [cls(e) for e in facts.equations] if facts.kind in _WITH_RATES else []

    @property
    def expression(self) -> str:
        """The even part of the damping."""
        return f"-D_a |{self.equation}'|"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The force along the motion."""
        return {self.equation: -self.D_a * abs(motion.rates[self.equation])}


class CubicStiffness(AbstractCoordinateForce):
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
    def replaces(self) -> tuple[str, ...]:
        """The linear spring."""
        return (f"K_{self.equation}",)

    @property
    def expression(self) -> str:
        """The restoring force."""
        return f"-k_3 {self.equation}³"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The restoring force along the motion."""
        return {self.equation: -self.k_3 * motion.positions[self.equation] ** 3}


class Saturation(AbstractCoordinateForce):
    r"""A restoring force that levels off: $F = -F_s\tanh(q/x_s)$, $F_s \ge 0$, $x_s > 0$ where it does so.

    Beside a linear spring it takes over part of that one's stiffness at small q. Limits of a drive are
    `actuator-saturation`. Source: Khalil (2002), §1.2; Schetzen (1980).
    """

    name: ClassVar[str] = "saturation"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    F_s: Array = amplitude("1", sign=+1)
    x_s: Array = shape("1", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[Saturation]":
        """Each coordinate of a mechanism, levelling off at a tenth of how far it went to all of it."""
        parts = (0.1, 0.2, 0.4, 0.7, 1.0)
        return [cls(e, x_s=number(part * far)) for e, far in facts.travel.items() for part in parts]

    @property
    def replaces(self) -> tuple[str, ...]:
        """The linear spring."""
        return (f"K_{self.equation}",)

    @property
    def expression(self) -> str:
        """The restoring force."""
        return f"-F_s tanh({self.equation} / x_s)"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The restoring force along the motion."""
        place = motion.positions[self.equation]
        xp = namespace(place, self.x_s)
        return {self.equation: -self.F_s * xp.tanh(place / xp.maximum(self.x_s, 1e-9))}
