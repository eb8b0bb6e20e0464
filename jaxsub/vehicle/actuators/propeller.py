"""Propellers by their open-water characteristics."""

import math
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...effects import Motion, Signal
from .base import Actuator, Load, equations_of, line, velocity_along
from .curve import evaluated, order
from .keys import Curve, Function, Key, Number, Pair, Vector, Word

_SLOWEST = 1e-6  # rev/s: below it there is no thrust, and no advance ratio


class Propeller(Actuator):
    r"""A propeller: thrust $T = \rho n|n|D^4K_T(J)$, $J = u_P/(|n|D)$, of which $(1 - t)T$ reaches the hull.

    n is the shaft speed in rev/s, the input in rad/s; $u_P = (1 - w)u_a$ with $u_a$ the speed through the water along
    the direction. Astern the characteristics are those ahead in reverse, times `reverse`. With $K_Q$ the torque
    $\rho n|n|D^5K_Q(J)$ turns the hull against a right-handed shaft. In a drift
    $1 - w = (1 - w_0)[1 + (1 - e^{-C_1|\beta_P|})(C_2 - 1)]$, $\beta_P = \beta - x r/U$.
    Source: Yasukawa and Yoshimura (2015), eqs. 13-17; Carlton (2018), §6.

    **Fields**

    - `position` m, `direction`: of its thrust ahead. `hand`: of the shaft.
    - `K_T`, `K_Q`: points by advance ratio J, where they are tables.
    - `numbers`: `diameter` D m; `K_T_0` … and `K_Q_0` … of polynomials in J; `wake` $w_0$, `thrust_deduction` t, `C_1`,
      `C_2` by the sign of $\beta_P$, `gain` on thrust and torque, `reverse`.
    """

    kind: ClassVar[str] = "propeller"
    command_unit: ClassVar[str] = "rad/s"
    keys: ClassVar[Mapping[str, Key]] = {
        "position": Vector("m", required=True),
        "direction": Vector(default=(1.0, 0.0, 0.0), direction=True),
        "diameter": Number("m", required=True, positive=True),
        "K_T": Function("1", required=True, columns=("J", "K_T"), units=("1", "1")),
        "K_Q": Function("1", columns=("J", "K_Q"), units=("1", "1")),
        "hand": Word(words=("right", "left"), default="right"),
        "wake": Number("1"),
        "C_1": Number("1"),
        "C_2": Pair("1", labels=("negative", "positive")),
        "thrust_deduction": Number("1"),
        "gain": Number("1"),
        "reverse": Number("1"),
    }

    position: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    direction: tuple[float, float, float] = eqx.field(static=True, default=(1.0, 0.0, 0.0))
    K_T: Curve | None = eqx.field(static=True, default=None)
    K_Q: Curve | None = eqx.field(static=True, default=None)
    hand: str = eqx.field(static=True, default="right")

    def check(self, beside: Mapping[str, Actuator]) -> tuple[str, str, str] | None:
        """The wake in a drift has both of its numbers."""
        if ("C_1" in self.numbers) != ("C_2_negative" in self.numbers):
            missing, there = ("C_2", "C_1") if "C_1" in self.numbers else ("C_1", "C_2")
            return missing, f"is missing beside {there}", f"add {missing} = …"
        return None

    def acts_on(self) -> tuple[str, ...]:
        """Along its line, and about it with a torque."""
        turned = [np.concatenate([np.zeros(3), self.direction])] if self._turns else []
        return equations_of(line(self.position, self.direction), *turned)

    @property
    def follows(self) -> bool:
        """Always."""
        return True

    @property
    def _turns(self) -> bool:
        return self.K_Q is not None or order("K_Q", self.numbers) > 0

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """What of the thrust reaches the hull, and the reaction of the torque."""
        ahead = (1.0 - self.value("thrust_deduction")) * self.thrust(motion)
        found: list[Load] = [(ahead, line(self.position, self.direction))]
        if self._turns:
            torque = self._characteristic("K_Q", self.K_Q, motion) * self.numbers["diameter"]
            against = -1.0 if self.hand == "right" else 1.0
            found.append((torque, against * np.concatenate([np.zeros(3), self.direction])))
        return found

    def thrust(self, motion: Motion) -> Signal:
        """T, N."""
        return self._characteristic("K_T", self.K_T, motion)

    def inflow(self, motion: Motion) -> Signal:
        """$u_P$, m/s."""
        ahead = (1.0 - self.value("wake")) * velocity_along(motion, line(self.position, self.direction))
        if "C_1" not in self.numbers:
            return ahead
        speed, angle = drift(motion)
        at = angle - self.position[0] * motion.flow["yaw"] / speed
        more = jnp.where(at < 0.0, self.numbers["C_2_negative"], self.numbers["C_2_positive"]) - 1.0
        return ahead * (1.0 - (jnp.exp(-self.numbers["C_1"] * abs(at)) - 1.0) * more)

    def _characteristic(self, key: str, points: Curve | None, motion: Motion) -> Signal:
        """$g\\rho n|n|D^4K(J)$."""
        diameter, turns = self.numbers["diameter"], self.command(motion) / (2.0 * math.pi)
        size = jnp.maximum(abs(turns), _SLOWEST)
        towards = jnp.where(turns < 0.0, -1.0, 1.0)
        coefficient = evaluated(key, points, self.numbers, towards * self.inflow(motion) / (size * diameter))
        strength = towards * jnp.where(turns < 0.0, self.value("reverse", 1.0), 1.0)
        flow = self.water(motion) * size**2 * diameter**4
        return self.value("gain", 1.0) * strength * flow * coefficient


def drift(motion: Motion) -> tuple[Signal, Signal]:
    r"""Speed through the water U in the plane of surge and sway (m/s), and drift $\beta = \mathrm{atan2}(-v, u)$."""
    u, v = motion.flow["surge"], motion.flow["sway"]
    still = 1e-12
    return jnp.sqrt(u**2 + v**2 + still), jnp.arctan2(-v, u + still)
