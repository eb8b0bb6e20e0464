"""Near the surface, near the bottom and on a tether: forces that change with where the body is."""

import abc
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..arrays import namespace
from ..parameters import number
from .base import AbstractForce, amplitude, shape
from .motion import EQUATIONS, FORCES, VELOCITIES, Facts, Motion, Signal, unit_per

# of the hull's diameter
_REACHES = (0.5, 1.0, 2.0, 4.0, 8.0)
# what a hull feels that a boundary draws to it
_FELT = ("heave", "pitch")


class _Suction(AbstractForce):
    """Heave and pitch that grow with the square of the speed and die out with the distance to a boundary."""

    heave: eqx.AbstractVar[Array]
    pitch: eqx.AbstractVar[Array]
    h: eqx.AbstractVar[Array]

    @property
    def where(self) -> tuple[str, ...]:
        """Heave, and pitch."""
        return _FELT

    def symbols(self) -> dict[str, str]:
        """`Z_suction`, `M_suction` and the reach `h`."""
        return {**{e: f"{FORCES[e]}_suction" for e in _FELT}, "h": "h"}

    def units(self) -> dict[str, str]:
        """Force and moment per square of the speed, and a length."""
        return {**{e: unit_per(e, "surge", "surge") for e in _FELT}, "h": "m"}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The suction along the motion."""
        xp = namespace(motion.rates["surge"], self.h)
        distance = xp.maximum(self.distance(motion), 0.0)
        near = motion.rates["surge"] ** 2 * xp.exp(-distance / xp.maximum(self.h, 1e-6))
        return {"heave": self.heave * near, "pitch": self.pitch * near}

    @abc.abstractmethod
    def distance(self, motion: Motion) -> Signal:
        """Distance of the boundary in `motion`, m."""


def _feels(facts: Facts) -> bool:
    return facts.kind == "submerged-body" and set(_FELT) <= set(facts.equations)


class FreeSurfaceSuction(_Suction):
    r"""Suction under the free surface: $[Z\,M] = [Z_s\,M_s]\,u^2 e^{-z/h}$ where $Z_s \le 0$ (up).

    $M_s$ has either sign, z is the depth and $h > 0$ the reach in m, one for both: what draws a hull to a boundary
    draws it off its middle too.

    Source: Crossland (2013), ISOPE, and Newman (1977), §6, for the decay with depth.
    """

    name: ClassVar[str] = "free-surface-suction"
    family: ClassVar[str] = "environment"
    heave: Array = amplitude("1", sign=-1)
    pitch: Array = amplitude("1")
    h: Array = shape("m", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[FreeSurfaceSuction]":
        """For a body that heaves, pitches and measures its depth, reaches of half to eight diameters that it felt."""
        if not _feels(facts) or not facts.measures_depth:
            return []
        reaches = [r * facts.diameter for r in _REACHES if facts.depth_range[0] < 5.0 * r * facts.diameter]
        return [cls(h=number(h)) for h in reaches]

    @property
    def expression(self) -> str:
        """The force."""
        return "[Z_suction, M_suction] u² exp(-depth/h)"

    def distance(self, motion: Motion) -> Signal:
        """The depth, m."""
        return motion.positions["z"]


class BottomSuction(_Suction):
    r"""Suction over the bottom: $[Z\,M] = [Z_s\,M_s]\,u^2 e^{-a/h}$ where $Z_s \ge 0$ (down).

    $M_s$ has either sign, a is the recorded `altitude` and $h > 0$ the reach in m, one for both.

    Source: Newman (1965), and Beck and Newman (1975), for bodies close to a wall.
    """

    name: ClassVar[str] = "bottom-suction"
    family: ClassVar[str] = "environment"
    heave: Array = amplitude("1", sign=+1)
    pitch: Array = amplitude("1")
    h: Array = shape("m", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[BottomSuction]":
        """For a body that heaves and pitches and whose recordings hold the altitude."""
        if not _feels(facts) or "altitude" not in facts.environment:
            return []
        return [cls(h=number(r * facts.diameter)) for r in _REACHES]

    @property
    def expression(self) -> str:
        """The force."""
        return "[Z_suction, M_suction] u² exp(-altitude/h)"

    def distance(self, motion: Motion) -> Signal:
        """The recorded altitude, m."""
        return motion.environment["altitude"]


class TetherDrag(AbstractForce):
    r"""Drag of a tether to the surface, as long as the body is deep: $[X\,Y\,Z] = -c\,z\,|V|\,[u\,v\,w]$.

    $c = \tfrac12\rho C_d d \ge 0$ in N/m per (m/s)², d the tether's diameter; $z \ge 0$ the depth. It acts at the
    centre of gravity and has no weight. Source: Fossen (2021), §9.6; Feng and Allen (2004), J. Oceanic Eng. 29(4).
    """

    name: ClassVar[str] = "tether-drag"
    family: ClassVar[str] = "environment"
    equations: tuple[str, ...] = eqx.field(static=True)
    c: Array = amplitude("N/m/(m/s)/(m/s)", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[TetherDrag]":
        """One, for a body that measures its depth and is free to translate."""
        moves = tuple(e for e in facts.equations if e in EQUATIONS[:3])
        deep = facts.kind == "submerged-body" and facts.measures_depth
        return [cls(moves)] if moves and deep else []

    @property
    def where(self) -> tuple[str, ...]:
        """The free translations."""
        return self.equations

    @property
    def expression(self) -> str:
        """The drag."""
        return f"-c z |V| ({', '.join(VELOCITIES[e] for e in self.equations)})"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The drag along the motion."""
        u, v, w = (motion.rates[e] for e in EQUATIONS[:3])
        # a speed of exactly zero has no derivative
        xp = namespace(u, self.c)
        speed = xp.sqrt(u**2 + v**2 + w**2 + 1e-12)
        drag = -self.c * xp.maximum(motion.positions["z"], 0.0) * speed
        return {e: drag * motion.rates[e] for e in self.equations}
