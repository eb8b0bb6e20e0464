"""Propulsion effects: what a propeller does besides pushing."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractDerivative, amplitude
from .derivatives import Derivative, Power
from .motion import FINS, FORCES, Facts


class PropellerTorque(AbstractDerivative):
    r"""Roll reaction of the propeller: $K = K_{nn}|n|n$ with recorded shaft speed, else a constant $K_Q$.

    At constant rpm this is indistinguishable from a trim offset or an asymmetric hull. Source: Fossen (2021), §9.5.
    """

    name: ClassVar[str] = "propeller-torque"
    family: ClassVar[str] = "propulsion"
    grows_with: str = eqx.field(static=True)
    torque: Array = amplitude("N*m")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PropellerTorque]":
        """One, for a submerged body free in roll."""
        if facts.kind != "submerged-body" or "roll" not in facts.equations:
            return []
        source = [name for name in ("shaft_speed", "thrust") if name in facts.actuators]
        return [cls(source[0] if source else "constant")]

    @property
    def derivative(self) -> Derivative:
        """Roll by what it grows with."""
        return Derivative("roll", () if self.grows_with == "constant" else (pushing(self.grows_with),))

    def symbols(self) -> dict[str, str]:
        """`K_Q`."""
        return {"torque": "K_Q"}


def pushing(by: str) -> Power:
    """What the forces of a propeller grow with: the recorded thrust (N), or $|n|n$ of the shaft speed n (rad/s)."""
    return Power(by) if by == "thrust" else Power(by, 2, odd=True)


class PropellerAsymmetry(AbstractDerivative):
    r"""Side force or moment of a propeller off the axis or in an uneven wake: $\tau_i = c\,s$ of either sign.

    s is the recorded thrust T, or $|n|n$ of the recorded shaft speed n; where that does not change, no one can tell it
    from an asymmetric hull. Source: Carlton (2018), §6 (propeller walk).
    """

    name: ClassVar[str] = "propeller-asymmetry"
    family: ClassVar[str] = "propulsion"
    equation: str = eqx.field(static=True)
    by: str = eqx.field(static=True)
    c: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PropellerAsymmetry]":
        """Each free equation across the hull, where propulsion is recorded."""
        across = [e for e in ("sway", "heave", "pitch", "yaw") if e in facts.equations]
        return [cls(e, by) for e in across for by in facts.propulsion[:1]]

    @property
    def derivative(self) -> Derivative:
        """The equation by the push."""
        return Derivative(self.equation, (pushing(self.by),))

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `Y_nn` or `N_T`."""
        return {"c": f"{FORCES[self.equation]}_{'T' if self.by == 'thrust' else 'nn'}"}


class PropellerRace(AbstractDerivative):
    r"""A fin in the race of the propeller: its force grows with thrust, $\tau_i = c\,\delta\,s$ of either sign.

    s is the recorded thrust T, or $|n|n$ of the recorded shaft speed n: by momentum theory the square of the speed at
    the fin is $u^2 + 8T/(\pi\rho D^2)$. Source: Fossen (2021), §9.5; Söding (1982).
    """

    name: ClassVar[str] = "propeller-race"
    family: ClassVar[str] = "actuators"
    equation: str = eqx.field(static=True)
    fin: str = eqx.field(static=True)
    by: str = eqx.field(static=True)
    c: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[PropellerRace]":
        """Each fin in the equations that it turns the body by, where propulsion is recorded."""
        pairs = [(e, fin) for fin in facts.fins for e in _turned(fin, facts) if e in facts.equations]
        return [cls(e, fin, by) for e, fin in pairs for by in facts.propulsion[:1]]

    @property
    def derivative(self) -> Derivative:
        """The equation by deflection and push."""
        return Derivative(self.equation, (Power(self.fin), pushing(self.by)))

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `N_rudder_nn` or `N_rudder_T`."""
        return {"c": f"{FORCES[self.equation]}_{self.fin}_{'T' if self.by == 'thrust' else 'nn'}"}


def _turned(fin: str, facts: Facts) -> tuple[str, ...]:
    """The equations of a fin's lift: a rudder's, a stern plane's, or where the vehicle has that of another name."""
    if fin in FINS:
        return ("sway", "yaw") if fin == "rudder" else ("heave", "pitch")
    return tuple(e for e, letter in FORCES.items() if f"{letter}_uu_{fin}" in facts.has)


class ThrusterCrossCoupling(AbstractDerivative):
    r"""An actuator that also acts on an equation other than its own: $\tau_i = c\,\delta_a$ of either sign.

    Source: Fossen (2021), §11.2: an entry of the thrust configuration matrix that the model has as zero.
    """

    name: ClassVar[str] = "thruster-cross-coupling"
    family: ClassVar[str] = "propulsion"
    equation: str = eqx.field(static=True)
    actuator: str = eqx.field(static=True)
    c: Array = amplitude("1")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ThrusterCrossCoupling]":
        """Each input but the main propulsion on each free equation but surge, where the model has none."""
        acting = [name for name in facts.actuators if name not in facts.propulsion]
        return [cls(e, a) for e in facts.equations if e != "surge" for a in acting]

    @property
    def derivative(self) -> Derivative:
        """The equation by the actuator."""
        return Derivative.by(self.equation, self.actuator)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `K_rudder`; `B_q_drive` for a mechanism's coordinate."""
        if self.equation in FORCES:
            return {"c": f"{FORCES[self.equation]}_{self.actuator}"}
        return {"c": f"B_{self.equation}_{self.actuator}"}
