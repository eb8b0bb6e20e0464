"""Hull effects: forces of the water on the body, besides damping, that a linear model leaves out."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from .base import AbstractDerivative, AbstractForce, amplitude
from .derivatives import Derivative
from .motion import EQUATIONS, FORCES, STANDARD_DENSITY, VELOCITIES, Facts, Motion, Signal, unit_per


class CrossflowDrag(AbstractForce):
    r"""Strip-theory drag of the flow across the hull, which couples sway with yaw or heave with pitch.

    $Y = -\tfrac12\rho D C_d \int_{-L/2}^{L/2} |v + xr|(v + xr)\,dx$ and
    $N = -\tfrac12\rho D C_d \int_{-L/2}^{L/2} x\,|v + xr|(v + xr)\,dx$;
    in the vertical plane with $w - xq$, $Z$ and $M$, the last with the opposite sign. $C_d \ge 0$, and $\rho$ is the
    `density`, kg/m³.
    Source: Fossen (2021), §6.4.2; Healey and Lienard (1993).
    """

    name: ClassVar[str] = "crossflow-drag"
    family: ClassVar[str] = "hull"
    plane: str = eqx.field(static=True)
    length: float = eqx.field(static=True)
    diameter: float = eqx.field(static=True)
    C_d: Array = amplitude("1", sign=+1)
    density: float = eqx.field(static=True, default=STANDARD_DENSITY)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[CrossflowDrag]":
        """The planes in which the vehicle is free to both translate and turn."""
        planes = {"horizontal": {"sway", "yaw"}, "vertical": {"heave", "pitch"}}
        free = set(facts.equations) if facts.kind == "submerged-body" else set()
        made = lambda plane: cls(plane, facts.length, facts.diameter, density=facts.density)
        return [made(plane) for plane, needs in planes.items() if needs <= free]

    @property
    def where(self) -> tuple[str, ...]:
        """The two equations that the plane couples."""
        return ("sway", "yaw") if self.plane == "horizontal" else ("heave", "pitch")

    @property
    def replaces(self) -> tuple[str, ...]:
        """Linear damping of the two equations by their own velocities."""
        return tuple(f"{FORCES[equation]}_{VELOCITIES[equation]}" for equation in self.where)

    @property
    def expression(self) -> str:
        """The integrals."""
        if self.plane == "horizontal":
            return "-½ρD C_d ∫ (1, x) |v + x r|(v + x r) dx"
        return "-½ρD C_d ∫ (1, -x) |w - x q|(w - x q) dx"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """Side force and moment, by Gauss-Legendre quadrature along the hull."""
        across, turning, arm = ("sway", "yaw", 1.0) if self.plane == "horizontal" else ("heave", "pitch", -1.0)
        nodes, weights = np.polynomial.legendre.leggauss(16)
        x, dx = 0.5 * self.length * nodes, 0.5 * self.length * weights
        local = motion.flow[across][..., None] + arm * x * motion.flow[turning][..., None]
        strips = -0.5 * self.density * self.diameter * self.C_d * abs(local) * local * dx
        total = namespace(strips).sum
        return {across: total(strips, -1), turning: total(arm * x * strips, -1)}


class CoriolisCoupling(AbstractForce):
    r"""Products of velocities from rigid body and added mass, beyond those that the linear model keeps.

    With $\tilde M = [M_{11}\,M_{12}; M_{21}\,M_{22}]$ and momentum $p = M_{11}\nu_1 + M_{12}\nu_2$,
    $h = M_{21}\nu_1 + M_{22}\nu_2$, Kirchhoff gives $C(\nu)\nu = [\nu_2\times p;\; \nu_2\times h + \nu_1\times p]$.
    This is a quadratic form, so what a linearisation about $(U_c, 0, …)$ leaves out is exactly
    $-k\,C(\delta\nu)\,\delta\nu$ with $\delta\nu = \nu - (U_c, 0, …)$; physics gives $k = 1$.
    Source: Fossen (2021), theorem 3.2 and §6.3 (with the Munk moment).
    """

    name: ClassVar[str] = "coriolis-coupling"
    family: ClassVar[str] = "hull"
    equations: tuple[str, ...] = eqx.field(static=True)
    fraction: Array = amplitude("1", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[CoriolisCoupling]":
        """One, for a body that can both translate and turn."""
        moves, turns = set(facts.equations) & set(EQUATIONS[:3]), set(facts.equations) & set(EQUATIONS[3:])
        return [cls(facts.equations)] if facts.kind == "submerged-body" and moves and turns else []

    @property
    def where(self) -> tuple[str, ...]:
        """Every free equation."""
        return self.equations

    @property
    def expression(self) -> str:
        """The quadratic form."""
        return "-k C(δν) δν, δν = ν - (U_c, 0, 0, 0, 0, 0)"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """Forces and moments of the momentum carried around."""
        xp = namespace(*(motion.flow[e] for e in EQUATIONS), self.fraction)
        rates = xp.stack(xp.broadcast_arrays(*(motion.flow[e] for e in EQUATIONS)), -1)
        deviation = rates - motion.cruise * xp.eye(6)[0]
        total = self.fraction * coriolis(motion.inertia, deviation)
        return {e: total[..., i] for i, e in enumerate(EQUATIONS) if e in self.equations}

    @property
    def term(self) -> str:
        """The full products of the vehicle file's `[model]`."""
        return "coriolis"


def coriolis(inertia: Float[Values, "6 6"], velocity: Float[Values, "*k 6"]) -> Float[Values, "*k 6"]:
    r"""$-C(\nu)\nu$: forces and moments (N, N m) of the momentum $[p; h] = M\nu$ that is carried around.

    By Kirchhoff $C(\nu)\nu = [\nu_2\times p;\; \nu_2\times h + \nu_1\times p]$, for rigid body and added mass alike.
    """
    xp = namespace(inertia, velocity)
    momentum = velocity @ inertia.T
    linear, angular, p, h = velocity[..., :3], velocity[..., 3:], momentum[..., :3], momentum[..., 3:]
    moment = xp.cross(angular, h) + xp.cross(linear, p)
    return -xp.concatenate([xp.cross(angular, p), moment], -1)


class TurningSpeedLoss(AbstractDerivative):
    r"""Surge resistance of manoeuvring: $X = X_{ab}\,a\,b$ for one pair of $v, r, w, q$ or a deflection.

    Squares must not propel ($X_{vv}, X_{rr}, X_{ww}, X_{qq}, X_{\delta\delta} \le 0$); $X_{vr}$ and $X_{wq}$,
    centripetal in kind, have either sign. Source: Abkowitz (1964); Norrbin (1971).
    """

    name: ClassVar[str] = "turning-speed-loss"
    family: ClassVar[str] = "hull"
    first: str = eqx.field(static=True)
    second: str = eqx.field(static=True)
    coefficient: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[TurningSpeedLoss]":
        """Products of the free velocities in each plane, and the square of each deflection."""
        if "surge" not in facts.equations:
            return []
        planes = [("sway", "yaw"), ("heave", "pitch")]
        pairs = [(a, b) for plane in planes for a, b in ((plane[0],) * 2, plane, (plane[1],) * 2)]
        free = [pair for pair in pairs if set(pair) <= set(facts.equations)]
        return [cls(*pair) for pair in free + [(fin, fin) for fin in facts.fins]]

    @property
    def derivative(self) -> Derivative:
        """The pair, in surge."""
        return Derivative.by("surge", self.first, self.second)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `X_vr`, or `X_rudder_rudder`."""
        a, b = self.first, self.second
        return {"coefficient": f"X_{VELOCITIES[a]}{VELOCITIES[b]}" if a in VELOCITIES else f"X_{a}_{b}"}

    def signs(self) -> dict[str, int]:
        """A square does not propel."""
        return {"coefficient": -1 if self.first == self.second else 0}


class SpeedScaling(AbstractForce):
    r"""Lift and rudder forces that grow with speed: $\tau_i = c\,(u - U_c)\,s$ for a velocity or deflection $s$.

    A linear model has $Y_v v$ at $U_c$; lift has $Y_{uv}\,u\,v$.
    Source: Prestero (2001), §4.5-4.6; Fossen (2021), §9.6.
    """

    name: ClassVar[str] = "speed-scaling"
    family: ClassVar[str] = "hull"
    equation: str = eqx.field(static=True)
    with_: str = eqx.field(static=True)
    coefficient: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SpeedScaling]":
        """Each lateral equation with the velocities and deflections of its own plane."""
        planes: dict[str, tuple[str, ...]] = {
            "sway": ("sway", "yaw"),
            "yaw": ("sway", "yaw"),
            "heave": ("heave", "pitch"),
            "pitch": ("heave", "pitch"),
            "roll": ("roll",),
        }
        if "surge" not in facts.equations:
            return []
        found = [cls(e, s) for e, plane in planes.items() for s in plane if {e, s} <= set(facts.equations)]
        rudders = [
            cls(e, a) for e in ("sway", "yaw") for a in facts.actuators if a == "rudder" and e in facts.equations
        ]
        planesmen = [
            cls(e, a) for e in ("heave", "pitch") for a in facts.actuators if "elevator" in a or a == "stern_plane"
            if e in facts.equations
        ]  # fmt: skip
        return found + rudders + planesmen

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `N_ur` or `N_u_rudder`."""
        tail = VELOCITIES.get(self.with_, f"_{self.with_}")
        return {"coefficient": f"{FORCES[self.equation]}_u{tail}"}

    def units(self) -> dict[str, str]:
        """Force per product."""
        return {"coefficient": unit_per(self.equation, "surge", self.with_)}

    @property
    def term(self) -> str:
        """The derivative by the product of speed and the other, such as `N_ur`."""
        return Derivative.by(self.equation, "surge", self.with_).name

    @property
    def expression(self) -> str:
        """The product."""
        return f"{self.symbols()['coefficient']} (u - U_c) {VELOCITIES.get(self.with_, self.with_)}"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The extra lift along the motion."""
        known = motion.flow | motion.actuators
        return {self.equation: self.coefficient * (motion.flow["surge"] - motion.cruise) * known[self.with_]}


class HullAsymmetry(AbstractDerivative):
    r"""A constant side force or moment of a hull that is not quite symmetric: $\tau_i = c$.

    Source: Fossen (2021), §9.4; model tests report it as $Y_*$, $N_*$ (Abkowitz 1964).
    """

    name: ClassVar[str] = "hull-asymmetry"
    family: ClassVar[str] = "hull"
    equation: str = eqx.field(static=True)
    constant: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[HullAsymmetry]":
        """Every free equation but surge, where a constant is thrust."""
        return [cls(e) for e in facts.equations if e in EQUATIONS[1:]]

    @property
    def derivative(self) -> Derivative:
        """A constant."""
        return Derivative(self.equation)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `Y_0`."""
        return {"constant": f"{FORCES[self.equation]}_0"}
