"""Thrusters, and actuators that act through coefficients alone."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ...effects import Motion, Signal
from .base import Actuator, Load, equations_of, line, velocity_along
from .curve import evaluated
from .keys import Curve, Function, Key, Number, Pair, Vector


class Thruster(Actuator):
    r"""A thruster at a fixed place: $F = g\,f(c) - T_{cu}|c|u_a$ along its direction.

    c is the command less `neutral`, without what its dead band takes away: $c - \mathrm{clip}(c, low, high)$. f is c
    itself, $k_f|c|c$ ahead and $k_r|c|c$ astern, a polynomial, or a table that is linear between its points and level
    beyond. $u_a$ is the speed through the water along the direction. Source: Fossen (2021), §9.1; Bessa et al. (2006)
    for the dead band.

    **Fields**

    - `position` m, `direction`: of the force that a positive command makes.
    - `thrust`: the points of f, N, where it is a table.
    - `numbers`: `gain` g (1); `neutral` and `dead_band`, in the input's unit; `forward` $k_f$ and `reverse` $k_r$ (as
      ahead where absent), N per its square; `advance` $T_{cu}$, N/(m/s) per the input's unit; `thrust_0` … of a
      polynomial.
    """

    kind: ClassVar[str] = "thruster"
    keys: ClassVar[Mapping[str, Key]] = {
        "position": Vector("m", required=True),
        "direction": Vector(required=True, direction=True),
        "gain": Number(),
        "neutral": Number(),
        "dead_band": Pair(sign=-1),
        "forward": Number(),
        "reverse": Number(),
        "thrust": Function(columns=("command", "thrust"), units=("", "N")),
        "advance": Number(),
    }

    position: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    direction: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    thrust: Curve | None = eqx.field(static=True, default=None)

    def check(self, beside: Mapping[str, Actuator]) -> tuple[str, str, str] | None:
        """One curve, not two."""
        if "reverse" in self.numbers and "forward" not in self.numbers:
            return "reverse", "is given without forward", "add forward = …"
        if "forward" in self.numbers and self.shaped:
            return "thrust", "is given beside forward", "give one curve"
        return None

    @property
    def shaped(self) -> bool:
        """Whether a table or a polynomial gives the thrust."""
        return self.thrust is not None or "thrust_0" in self.numbers

    @property
    def input_unit(self) -> str:
        """A force where nothing makes one of it."""
        return "" if self.shaped or {"forward", "gain"} & self.numbers.keys() else "N"

    def unit_of(self, key: str, stated: str) -> str:
        """Of what depends on the input's unit."""
        per = f"/({stated})" if stated else ""
        by_key = {
            "gain": "1" if self.shaped or "forward" in self.numbers else stated and f"N{per}",
            "neutral": stated,
            "dead_band": stated,
            "forward": stated and f"N{per}{per}",
            "reverse": stated and f"N{per}{per}",
            "advance": stated and f"N/(m/s){per}",
        }
        return by_key.get(key, "")

    def acts_on(self) -> tuple[str, ...]:
        """Along its line."""
        return equations_of(line(self.position, self.direction))

    @property
    def factor(self) -> str:
        """The gain, on which what is lost by advance does not depend."""
        return "" if self.follows else "gain"

    @property
    def follows(self) -> bool:
        """With a loss of thrust by advance."""
        return "advance" in self.numbers

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """The thrust."""
        along, command = line(self.position, self.direction), self.command(motion)
        if "neutral" in self.numbers:
            command = command - self.numbers["neutral"]
        if "dead_band_low" in self.numbers:
            command = command - jnp.clip(command, self.numbers["dead_band_low"], self.numbers["dead_band_high"])
        force = self.value("gain", 1.0) * self._curve(command)
        if self.follows:
            force = force - self.numbers["advance"] * abs(command) * velocity_along(motion, along)
        return [(force, along)]

    def _curve(self, command: Signal) -> Signal:
        if self.shaped:
            return evaluated("thrust", self.thrust, self.numbers, command)
        if "forward" not in self.numbers:
            return command
        ahead = self.numbers["forward"]
        factor = jnp.where(command < 0.0, self.value("reverse", ahead), ahead) if "reverse" in self.numbers else ahead
        return factor * abs(command) * command


class Generic(Actuator):
    """An actuator that acts through coefficients such as `B_yaw_NAME` or `N_delta_r` alone."""

    kind: ClassVar[str] = "generic"
    keys: ClassVar[Mapping[str, Key]] = {}

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """None."""
        return []
