"""Near the surface, near the bottom and on a tether: forces that change with where the body is."""

import abc
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array

from ..parameters import number
from .base import AbstractForce, amplitude, shape
from .motion import EQUATIONS, FORCES, VELOCITIES, Facts, Motion, Signal, unit_per

# of the hull's diameter
_REACHES = (0.5, 1.0, 2.0, 4.0, 8.0)


class _Suction(AbstractForce):
    """A force that grows with the square of the speed and dies out with the distance to a boundary."""

    equation: eqx.AbstractVar[str]
    coefficient: eqx.AbstractVar[Array]
    h: eqx.AbstractVar[Array]
    # of the heave force: towards the boundary
    towards: eqx.AbstractClassVar[int]

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `Z_suction`, and the reach `h`."""
        return {"coefficient": f"{FORCES[self.equation]}_suction", "h": "h"}

    def units(self) -> dict[str, str]:
        """Force per square of the speed, and a length."""
        return {"coefficient": unit_per(self.equation, "surge", "surge"), "h": "m"}

    def signs(self) -> dict[str, int]:
        """Heave towards the boundary, pitch either way, a reach above zero."""
        return {"coefficient": self.towards if self.equation == "heave" else 0, "h": 1}

    @property
    def expression(self) -> str:
        """The force."""
        away = "depth" if self.towards < 0 else "altitude"
        return f"{FORCES[self.equation]}_suction u² exp(-{away}/h)"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The suction along the motion."""
        distance = jnp.maximum(self.distance(motion), 0.0)
        near = jnp.exp(-distance / jnp.maximum(self.h, 1e-6))
        return {self.equation: self.coefficient * motion.rates["surge"] ** 2 * near}

    @abc.abstractmethod
    def distance(self, motion: Motion) -> Signal:
        """How far the boundary is, m."""


def _felt(facts: Facts) -> list[str]:
    return [e for e in ("heave", "pitch") if facts.kind == "submerged-body" and e in facts.equations]


class FreeSurfaceSuction(_Suction):
    r"""Suction under the free surface: $Z = Z_s u^2 e^{-z/h}$ with $Z_s \le 0$ (up), or the same in M with either sign.

    z is the depth, $h > 0$ the reach in m.

    Source: Crossland (2013), ISOPE, and Newman (1977), §6, for the decay with depth.
    """

    name: ClassVar[str] = "free-surface-suction"
    family: ClassVar[str] = "environment"
    towards: ClassVar[int] = -1
    equation: str = eqx.field(static=True)
    coefficient: Array = amplitude("1")
    h: Array = shape("m", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[FreeSurfaceSuction]":
        """Heave and pitch of a body that measures its depth, with reaches of half to eight diameters that it felt."""
        felt = _felt(facts) if {"z", "depth"} & set(facts.channels) else []
        reaches = [r * facts.diameter for r in _REACHES if facts.depth_range[0] < 5.0 * r * facts.diameter]
        return [cls(e, h=number(h)) for e in felt for h in reaches]

    def distance(self, motion: Motion) -> Signal:
        """The depth, m."""
        return motion.positions["z"]


class BottomSuction(_Suction):
    r"""Suction over the bottom: $Z = Z_s u^2 e^{-a/h}$ with $Z_s \ge 0$ (down), or the same in M with either sign.

    a is the recorded `altitude`, $h > 0$ the reach in m.

    Source: Newman (1965), and Beck and Newman (1975), for bodies close to a wall.
    """

    name: ClassVar[str] = "bottom-suction"
    family: ClassVar[str] = "environment"
    towards: ClassVar[int] = 1
    equation: str = eqx.field(static=True)
    coefficient: Array = amplitude("1")
    h: Array = shape("m", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[BottomSuction]":
        """Heave and pitch of a body whose recordings hold the altitude."""
        felt = _felt(facts) if "altitude" in facts.environment else []
        return [cls(e, h=number(r * facts.diameter)) for e in felt for r in _REACHES]

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
        deep = facts.kind == "submerged-body" and bool({"z", "depth"} & set(facts.channels))
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
        speed = jnp.sqrt(u**2 + v**2 + w**2 + 1e-12)
        drag = -self.c * jnp.maximum(motion.positions["z"], 0.0) * speed
        return {e: drag * motion.rates[e] for e in self.equations}
