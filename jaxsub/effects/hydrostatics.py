"""Hydrostatic effects: weight, buoyancy and where they act."""

import abc
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..arrays import namespace
from .base import AbstractForce, amplitude
from .motion import GRAVITY, STANDARD_DENSITY, Facts, Motion, Signal

REFERENCE_TEMPERATURE = 288.15


def lift(motion: Motion, newton: Signal) -> dict[str, Signal]:
    """Body-axis force of `newton` of extra buoyancy: up, turned by the attitude. Source: Fossen (2021), §4.1."""
    phi, theta = motion.positions["phi"], motion.positions["theta"]
    xp = namespace(phi, theta)
    return {
        "surge": newton * xp.sin(theta),
        "sway": -newton * xp.sin(phi) * xp.cos(theta),
        "heave": -newton * xp.cos(phi) * xp.cos(theta),
    }


def lift_moments(motion: Motion, axis: str, arm: Signal | float) -> dict[str, Signal]:
    """Moment of a lift that acts off the origin along a body `axis`; `arm` is the lift times its distance, N m."""
    phi, theta = motion.positions["phi"], motion.positions["theta"]
    xp = namespace(phi, theta)
    level, rolled, pitched = xp.cos(phi) * xp.cos(theta), xp.sin(phi) * xp.cos(theta), xp.sin(theta)
    moments: dict[str, dict[str, Signal]] = {
        "x": {"pitch": arm * level, "yaw": -arm * rolled},
        "y": {"roll": -arm * level, "yaw": -arm * pitched},
        "z": {"roll": arm * rolled, "pitch": arm * pitched},
    }
    return moments[axis]


def _floats(facts: Facts) -> bool:
    return facts.kind == "submerged-body" and bool({"surge", "heave"} & set(facts.equations))


def _dives(facts: Facts) -> bool:
    return _floats(facts) and facts.depth_range[0] < facts.depth_range[1]


class _ExtraBuoyancy(AbstractForce):
    """A change of displaced weight that the recorded ballast and density do not account for."""

    @property
    def where(self) -> tuple[str, ...]:
        """Extra lift is felt in heave first."""
        return ("heave", "surge")

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The extra lift in body axes."""
        return lift(motion, self.newton(motion))

    @abc.abstractmethod
    def newton(self, motion: Motion) -> Signal:
        """Extra buoyancy in `motion`, N."""


class TrimOffset(AbstractForce):
    r"""A centre of buoyancy that is not where the vehicle file puts it: $\Delta x_B, \Delta y_B$ or $\Delta z_B$.

    $K = B(-\Delta y_B\cos\phi\cos\theta + \Delta z_B\sin\phi\cos\theta)$, $M = B(\Delta x_B\cos\phi\cos\theta +
    \Delta z_B\sin\theta)$, $N = -B(\Delta x_B\sin\phi\cos\theta + \Delta y_B\sin\theta)$. Source: Fossen (2021), §4.1.
    """

    name: ClassVar[str] = "trim-offset"
    family: ClassVar[str] = "hydrostatics"
    axis: str = eqx.field(static=True)
    offset: Array = amplitude("m")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[TrimOffset]":
        """The axes whose moment a free equation feels."""
        if facts.kind != "submerged-body":
            return []
        felt = {"x": {"pitch", "yaw"}, "y": {"roll", "yaw"}, "z": {"roll", "pitch"}}
        return [cls(axis) for axis, equations in felt.items() if equations & set(facts.equations)]

    @property
    def where(self) -> tuple[str, ...]:
        """The equations that feel the moment, the most affected first."""
        return {"x": ("pitch", "yaw"), "y": ("roll", "yaw"), "z": ("roll", "pitch")}[self.axis]

    def symbols(self) -> dict[str, str]:
        """`delta_x_B` and so on."""
        return {"offset": f"delta_{self.axis}_B"}

    @property
    def expression(self) -> str:
        """The main moment."""
        return {
            "x": "M += Δx_B B cosφ cosθ, N -= Δx_B B sinφ cosθ",
            "y": "K -= Δy_B B cosφ cosθ, N -= Δy_B B sinθ",
            "z": "K += Δz_B B sinφ cosθ, M += Δz_B B sinθ",
        }[self.axis]

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The moments along the motion."""
        return lift_moments(motion, self.axis, self.offset * motion.buoyancy)


class BuoyancyError(_ExtraBuoyancy):
    r"""A displacement or weight that is not what the vehicle file says: $\Delta B$ constant. Source: Archimedes."""

    name: ClassVar[str] = "buoyancy-error"
    family: ClassVar[str] = "hydrostatics"
    delta_B: Array = amplitude("N")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[BuoyancyError]":
        """One, for a body free in surge or heave."""
        return [cls()] if _floats(facts) else []

    @property
    def expression(self) -> str:
        """The constant."""
        return "ΔB"

    def newton(self, motion: Motion) -> Signal:
        """Extra buoyancy, N."""
        return self.delta_B + 0.0 * motion.positions["theta"]


class HullCompressibility(_ExtraBuoyancy):
    r"""A hull that shrinks under pressure: $\Delta B = -B\,\kappa\,\rho g z$, $\kappa \ge 0$ in 1/Pa.

    Seaglider-class hulls have 3e-10 to 6e-10 1/Pa (3e-6 to 6e-6 per dbar); sea water has 4.4e-10.
    Source: Eriksen et al. (2001), IEEE J. Oceanic Eng. 26(4); Frajka-Williams et al. (2011).
    """

    name: ClassVar[str] = "hull-compressibility"
    family: ClassVar[str] = "hydrostatics"
    kappa: Array = amplitude("1/Pa", sign=+1)
    density: float = eqx.field(static=True, default=STANDARD_DENSITY)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[HullCompressibility]":
        """One, for a body free in surge or heave that dives."""
        return [cls(density=facts.density)] if _dives(facts) else []

    @property
    def expression(self) -> str:
        """The lost buoyancy."""
        return "ΔB = -B κ ρ g z"

    def newton(self, motion: Motion) -> Signal:
        """Extra buoyancy, N."""
        return -motion.buoyancy * self.kappa * self.density * GRAVITY * motion.positions["z"]


class DensityStratification(_ExtraBuoyancy):
    r"""Water that grows denser with depth where no density was recorded.

    $\Delta B = B\,\gamma z$ with $\gamma \ge 0$ in 1/m.
    Compression of sea water alone is 4.5e-6 1/m; a stratified thermocline adds 1e-6 to 1e-4. Source: Gill (1982), §3.
    """

    name: ClassVar[str] = "density-stratification"
    family: ClassVar[str] = "hydrostatics"
    gamma: Array = amplitude("1/m", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[DensityStratification]":
        """One, for a body that dives and whose recordings hold no density."""
        return [cls()] if _dives(facts) and "density" not in facts.environment else []

    @property
    def expression(self) -> str:
        """The gained buoyancy."""
        return "ΔB = B γ z"

    def newton(self, motion: Motion) -> Signal:
        """Extra buoyancy, N."""
        return motion.buoyancy * self.gamma * motion.positions["z"]


class ThermalExpansion(_ExtraBuoyancy):
    r"""A hull that swells with temperature: $\Delta B = B\,\alpha\,(T - 288.15\,\mathrm{K})$, $\alpha \ge 0$ in 1/K.

    Aluminium has 7e-5 1/K by volume. Source: Eriksen et al. (2001); Frajka-Williams et al. (2011).
    """

    name: ClassVar[str] = "thermal-expansion"
    family: ClassVar[str] = "hydrostatics"
    alpha: Array = amplitude("1/K", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ThermalExpansion]":
        """One, for a floating body whose recordings hold the temperature."""
        return [cls()] if _floats(facts) and "temperature" in facts.environment else []

    @property
    def expression(self) -> str:
        """The gained buoyancy."""
        return "ΔB = B α (T - 288.15 K)"

    def newton(self, motion: Motion) -> Signal:
        """Extra buoyancy, N."""
        return motion.buoyancy * self.alpha * (motion.environment["temperature"] - REFERENCE_TEMPERATURE)
