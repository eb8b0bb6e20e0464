"""Actuator effects without a memory: what a deflection is of the command at the same time."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..parameters import number
from .actuators import PARTS
from .base import AbstractCurve, amplitude, shape
from .motion import Facts


class ActuatorSaturation(AbstractCurve):
    r"""A stop: $|\delta| \le \delta_{max}$, $\delta_{max} > 0$ in the actuator's unit. Source: Fossen (2021), §9.5."""

    name: ClassVar[str] = "actuator-saturation"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    limit: Array = shape("1", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorSaturation]":
        """Each actuator with limits from half to just below its largest command."""
        parts = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98)
        return [cls(name, number(part * size)) for name, size in facts.largest_commands.items() for part in parts]

    @property
    def expression(self) -> str:
        """The limit."""
        return f"|{self.actuator}| <= limit"

    def bend(self, command: Float[Array, " *k"]) -> Float[Array, " *k"]:
        """The limited deflection."""
        return jnp.clip(command, -self.limit, self.limit)


class ActuatorDeadband(AbstractCurve):
    r"""A command too small to move anything is lost: $\delta = \mathrm{sign}(\delta_{cmd})\max(|\delta_{cmd}| - d, 0)$.

    $d > 0$ in the actuator's unit.

    Source: Tao and Kokotovic (1996), §2.
    """

    name: ClassVar[str] = "actuator-deadband"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    d: Array = shape("1", sign=+1, default=0.01)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorDeadband]":
        """Each actuator with bands of a few to forty per cent of its largest command."""
        return [cls(name, number(part * size)) for name, size in facts.largest_commands.items() for part in PARTS]

    @property
    def expression(self) -> str:
        """The band."""
        return f"{self.actuator} = sign(command) max(|command| - d, 0)"

    def bend(self, command: Float[Array, " *k"]) -> Float[Array, " *k"]:
        """What is left of the command."""
        return command - jnp.clip(command, -self.d, self.d)


class ActuatorMisalignment(AbstractCurve):
    r"""A control surface that is mounted or zeroed askew: $\delta = \delta_{cmd} + b$ in rad, of either sign.

    Source: Fossen (2021), §9.4; a constant force of the fin, so a rival of an asymmetric hull.
    """

    name: ClassVar[str] = "actuator-misalignment"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    b: Array = amplitude("rad")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorMisalignment]":
        """Each control surface of a body."""
        return [cls(name) for name in facts.fins]

    @property
    def expression(self) -> str:
        """The offset."""
        return f"{self.actuator} = command + b"

    def bend(self, command: Float[Array, " *k"]) -> Float[Array, " *k"]:
        """The offset deflection."""
        return command + self.b


class ControlSurfaceStall(AbstractCurve):
    r"""A fin whose lift falls off at large deflections: it acts as one of $\delta - k\delta^3$, $k \ge 0$ in 1/rad².

    The first term of a lift curve that bends over; the inflow angle of the hull is left out.
    Source: Whicker and Fehlner (1958), DTMB 933; Abkowitz (1964), $Y_{\delta\delta\delta}$.
    """

    name: ClassVar[str] = "control-surface-stall"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    k: Array = amplitude("1/rad/rad", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ControlSurfaceStall]":
        """Each control surface of a body."""
        return [cls(name) for name in facts.fins]

    @property
    def expression(self) -> str:
        """The bent lift curve."""
        return f"{self.actuator} acts as command - k command³"

    def bend(self, command: Float[Array, " *k"]) -> Float[Array, " *k"]:
        """The deflection that would have the same lift without stall."""
        return command - self.k * command**3
