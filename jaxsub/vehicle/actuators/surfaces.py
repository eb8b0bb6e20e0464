"""Fins, and rudders behind a propeller."""

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...effects import EQUATIONS, Motion, Signal
from .base import Actuator, Load, equations_of, line, velocity_along
from .keys import Flag, Key, Number, Pair, Vector, Word
from .propeller import Propeller, drift

_AXES = np.eye(6)


class Fin(Actuator):
    r"""A control surface: lift $L = s\,|u_f|(u_f\delta - w_f)$ along its direction, drag $d\,u_f^2\delta^2$ astern.

    $s = \tfrac12\rho A C_{L\alpha}$ or `derivative`, $d = \tfrac12\rho A C_{D\delta\delta}$. $u_f$ and $w_f$ are the
    velocities through the water of the fin's place ahead and along its direction; without `inflow` $w_f$ is left out,
    as it must be where the hull's derivatives hold the fixed fin's. Source: Prestero (2001), §4.6.

    **Fields**

    - `position` m, `direction`: in which a positive deflection pushes.
    - `numbers`: `area` A m² and `lift_slope` 1/rad, or `derivative` s, N/(m/s)²/rad; `drag` $C_{D\delta\delta}$ 1/rad²,
      with `area`; `gain` on both (1).
    - `inflow`: whether its own motion changes the angle of attack.
    """

    kind: ClassVar[str] = "fin"
    command_unit: ClassVar[str] = "rad"
    keys: ClassVar[Mapping[str, Key]] = {
        "position": Vector("m", required=True),
        "direction": Vector(required=True, direction=True),
        "area": Number("m^2", positive=True),
        "lift_slope": Number("1/rad"),
        "derivative": Number("N/(m/s)/(m/s)/rad"),
        "drag": Number("1/rad/rad"),
        "gain": Number("1"),
        "inflow": Flag(),
    }

    position: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    direction: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    inflow: bool = eqx.field(static=True, default=True)

    def check(self, beside: Mapping[str, Actuator]) -> tuple[str, str, str] | None:
        """A direction across the flow; an area with a slope, or a derivative."""
        given = self.numbers.keys()
        if abs(self.direction[0]) > 1e-9:
            return "direction", "has a part ahead, and lift is across the flow", "give one such as [0, 1, 0]"
        if "derivative" in given and "lift_slope" in given:
            return "lift_slope", "is given beside derivative", "delete one"
        if "derivative" not in given and "lift_slope" not in given:
            return "lift_slope", "is missing", "add area and lift_slope, or derivative"
        if "area" not in given and given & {"lift_slope", "drag"}:
            return "area", "is missing", "add area = … in m²"
        return None

    def acts_on(self) -> tuple[str, ...]:
        """Along its line."""
        return equations_of(line(self.position, self.direction))

    @property
    def lifts(self) -> bool:
        """Always."""
        return True

    @property
    def follows(self) -> bool:
        """Always."""
        return True

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """Lift, and drag where there is any."""
        along, astern = line(self.position, self.direction), -line(self.position, (1.0, 0.0, 0.0))
        ahead, delta = -velocity_along(motion, astern), self.command(motion)
        incidence = ahead * delta
        if self.inflow:
            incidence = incidence - velocity_along(motion, along)
        slope = self._slope(self.water(motion))
        found: list[Load] = [(slope * abs(ahead) * incidence, along)]
        if "drag" in self.numbers:
            half = 0.5 * self.value("gain", 1.0) * self.water(motion) * self.numbers["area"]
            found.append((half * self.numbers["drag"] * (ahead * delta) ** 2, astern))
        return found

    def _slope(self, density: Signal | float) -> Any:
        gain = self.value("gain", 1.0)
        if "derivative" in self.numbers:
            return gain * self.numbers["derivative"]
        return 0.5 * gain * density * self.numbers["area"] * self.numbers["lift_slope"]


class Rudder(Actuator):
    r"""A rudder of the MMG standard method, in the race of a propeller where it names one.

    $F_N = \tfrac12\rho A_R f_\alpha U_R^2\sin\alpha_R$, $U_R^2 = u_R^2 + v_R^2$,
    $\alpha_R = \delta - \mathrm{atan2}(v_R, u_R)$;
    $X = -(1 - t_R)F_N\sin\delta$, $Y = -(1 + a_H)F_N\cos\delta$, $N = -(x_R + a_H x_H)F_N\cos\delta$.
    $v_R = \gamma_R(U\beta - \ell_R r)$ with $\gamma_R$ by the sign of what is in brackets, $\beta = \mathrm{atan2}(-v,
    u)$. With $u_P$ the propeller's inflow and T its thrust
    $u_R = \epsilon\sqrt{\eta[u_P + \kappa(\sqrt{u_P^2 + 8T/\pi\rho D^2} - u_P)]^2 + (1 - \eta)u_P^2}$, else
    $u_R = \epsilon u$. A positive deflection turns to starboard.
    Source: Yasukawa and Yoshimura (2015), J. Mar. Sci. Technol. 20, eqs. 18-27.

    **Fields**

    - `position` m: of the rudder. `propeller`: an actuator of that kind, or none.
    - `numbers`: `area` m²; `lift_slope` $f_\alpha$ 1/rad, or `aspect_ratio` $\Lambda$ with
      $f_\alpha = 6.13\Lambda/(\Lambda + 2.25)$; `gain` on $F_N$ (1); `t_R`, `a_H`, `x_H` m,
      `epsilon`, `kappa`, `eta`, `l_R` m, and `gamma_R` with drift to port (brackets negative) and to starboard.
    """

    kind: ClassVar[str] = "rudder"
    command_unit: ClassVar[str] = "rad"
    keys: ClassVar[Mapping[str, Key]] = {
        "position": Vector("m", required=True),
        "propeller": Word(),
        "area": Number("m^2", required=True, positive=True),
        "gain": Number("1"),
        "lift_slope": Number("1/rad"),
        "aspect_ratio": Number("1", positive=True),
        "t_R": Number("1"),
        "a_H": Number("1"),
        "x_H": Number("m"),
        "epsilon": Number("1"),
        "kappa": Number("1"),
        "eta": Number("1"),
        "l_R": Number("m"),
        "gamma_R": Pair("1", labels=("negative", "positive")),
    }

    position: tuple[float, float, float] = eqx.field(static=True, kw_only=True)
    propeller: str = eqx.field(static=True, default="")

    def check(self, beside: Mapping[str, Actuator]) -> tuple[str, str, str] | None:
        """One lift slope, and a propeller that there is."""
        slopes = self.numbers.keys() & {"lift_slope", "aspect_ratio"}
        if len(slopes) != 1:
            return "lift_slope", "is " + ("given beside aspect_ratio" if slopes else "missing"), "give one of both"
        if self.propeller and not isinstance(beside.get(self.propeller), Propeller):
            return "propeller", f"{self.propeller!r:.60} is no propeller of [actuators]", "name one, or delete the line"
        return None

    def acts_on(self) -> tuple[str, ...]:
        """Sway and yaw, and roll where it is above or below the origin."""
        return equations_of(line(self.position, (0.0, 1.0, 0.0)))

    @property
    def lifts(self) -> bool:
        """Always."""
        return True

    @property
    def follows(self) -> bool:
        """Always."""
        return True

    def loads(self, motion: Motion, beside: Mapping[str, Actuator]) -> list[Load]:
        """Surge, sway, roll and yaw."""
        delta, value = self.command(motion), self.value
        across, ahead = self._across(motion), self._ahead(motion, beside.get(self.propeller))
        angle = delta - jnp.arctan2(across, ahead + 1e-12)  # which has a slope at rest too
        strength = 0.5 * value("gain", 1.0) * self.water(motion) * value("area") * self._slope()
        force = strength * (ahead**2 + across**2) * jnp.sin(angle)
        side, hull = force * jnp.cos(delta), 1.0 + value("a_H")
        x, _, z = self.position
        found = [
            (-(1.0 - value("t_R")) * force * jnp.sin(delta), _AXES[EQUATIONS.index("surge")]),
            (-hull * side, _AXES[EQUATIONS.index("sway")] - z * _AXES[EQUATIONS.index("roll")]),
            (-(x + value("a_H") * value("x_H")) * side, _AXES[EQUATIONS.index("yaw")]),
        ]
        return [(jnp.asarray(size), np.asarray(along)) for size, along in found]

    def _slope(self) -> Any:
        if "lift_slope" in self.numbers:
            return self.numbers["lift_slope"]
        ratio = self.numbers["aspect_ratio"]
        return 6.13 * ratio / (ratio + 2.25)

    def _across(self, motion: Motion) -> Signal:
        speed, angle = drift(motion)
        drifted = speed * angle - self.value("l_R", self.position[0]) * motion.flow["yaw"]
        if "gamma_R_negative" not in self.numbers:
            return drifted
        low, high = self.numbers["gamma_R_negative"], self.numbers["gamma_R_positive"]
        return jnp.where(drifted < 0.0, low, high) * drifted

    def _ahead(self, motion: Motion, propeller: Actuator | None) -> Signal:
        epsilon = self.value("epsilon", 1.0)
        if not isinstance(propeller, Propeller):
            return epsilon * motion.flow["surge"]
        slow, thrust = propeller.inflow(motion), propeller.thrust(motion)
        disc = 8.0 / (math.pi * self.water(motion) * propeller.numbers["diameter"] ** 2)
        # a propeller that brakes has no race
        fast = jnp.sqrt(jnp.maximum(slow**2 + disc * thrust, 1e-12))
        race = slow + self.value("kappa", 0.5) * (fast - slow)
        eta = self.value("eta", 1.0)
        return epsilon * jnp.sqrt(eta * race**2 + (1.0 - eta) * slow**2 + 1e-12)
