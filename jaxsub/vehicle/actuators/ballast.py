"""Ballast that is pumped, and mass that is moved."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import numpy as np

from ...effects import GRAVITY, Motion
from ..attitude import down
from .base import Actuator, Load, equations_of, line
from .keys import Key, Number, Vector, Word


class Ballast(Actuator):
    r"""Water taken in or volume displaced at a fixed place: $F = (m - \rho V)g$ downwards.

    Of `of = "volume"`, a buoyancy engine, the command is V in m³ and m is 0; of `of = "mass"`, a tank, it is m in kg
    and V is 0. The body's inertia stays as it is. Source: Fossen (2021), §4.2.

    **Fields**

    - `position` m. `of`: what the command is.
    - `numbers`: `gain` on the command (1).
    """

    kind: ClassVar[str] = "ballast"
    keys: ClassVar[Mapping[str, Key]] = {
        "position": Vector("m", required=True),
        "of": Word(words=("volume", "mass"), default="volume"),
        "gain": Number("1"),
    }

    position: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    of: str = eqx.field(static=True, default="volume")

    @property
    def input_unit(self) -> str:
        """Of the command."""
        return "m^3" if self.of == "volume" else "kg"

    def acts_on(self) -> tuple[str, ...]:
        """Heave, and pitch and roll by its place; surge, sway and yaw with the attitude."""
        return equations_of(line(self.position, (0.0, 0.0, 1.0)))

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """Weight and buoyancy along the body's axes."""
        density = -self.water(motion) if self.of == "volume" else 1.0
        excess = GRAVITY * density * self.value("gain", 1.0) * self.command(motion)
        return [
            (excess * part, line(self.position, axis))
            for part, axis in zip(down(motion.positions), np.eye(3), strict=True)
        ]


class MovingMass(Actuator):
    r"""A mass of the body that is moved by s along a direction d: $\tau = s\,d\times m g\,n$, n downwards.

    Without a command it is where the centre of gravity and the inertia hold, and the inertia stays as it is.
    Source: Graver (2005), §4.1; Fossen (2021), §4.2.

    **Fields**

    - `direction`: in which a positive command (m) moves it.
    - `numbers`: `mass` kg.
    """

    kind: ClassVar[str] = "moving-mass"
    command_unit: ClassVar[str] = "m"
    keys: ClassVar[Mapping[str, Key]] = {
        "direction": Vector(required=True, direction=True),
        "mass": Number("kg", required=True, positive=True),
    }

    direction: tuple[float, float, float] = eqx.field(static=True, kw_only=True)

    @property
    def factor(self) -> str:
        """The mass."""
        return "mass"

    def acts_on(self) -> tuple[str, ...]:
        """About the axes across a horizontal direction; all of them with the attitude."""
        return equations_of(_moment(self.direction, (0.0, 0.0, 1.0)))

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """Moments about the body's axes."""
        weight = GRAVITY * self.numbers["mass"] * self.command(motion)
        return [
            (weight * part, _moment(self.direction, axis))
            for part, axis in zip(down(motion.positions), np.eye(3), strict=True)
            if np.any(_moment(self.direction, axis))
        ]


def _moment(arm: tuple[float, ...], force: tuple[float, ...] | np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros(3), np.cross(arm, force)])
