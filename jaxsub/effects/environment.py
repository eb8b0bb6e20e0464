"""The water that moves: currents and waves."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array

from ..arrays import namespace
from ..parameters import number
from .base import AbstractFlow, AbstractForce, amplitude, shape
from .motion import FORCES, Facts, Motion, Signal, unit_per

# s
_LONGEST_PERIOD = 30.0


class Current(AbstractFlow):
    r"""A steady horizontal current $V_N, V_E$ (m/s, over ground, of either sign), where velocities are over ground.

    In body axes $v_c = R(\phi,\theta,\psi)^T[V_N\,V_E\,0]$; all forces of the water follow $\nu - [v_c\,0]$, as
    where a current is recorded (`[environment]`). Source: Fossen (2021), §10.3.
    """

    name: ClassVar[str] = "current"
    family: ClassVar[str] = "environment"
    equations: tuple[str, ...] = eqx.field(static=True)
    V_N: Array = amplitude("m/s")
    V_E: Array = amplitude("m/s")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[Current]":
        """One, for a body that turns: to one that does not, it is a constant force."""
        return [cls(facts.equations)] if facts.kind == "submerged-body" and "yaw" in facts.equations else []

    @property
    def where(self) -> tuple[str, ...]:
        """Every free equation, those across the hull first."""
        order = ("sway", "yaw", "heave", "pitch", "surge", "roll")
        return tuple(e for e in order if e in self.equations)

    @property
    def expression(self) -> str:
        """The force to first order, with A the slopes of the forces of the water by velocities."""
        return "-A Rᵀ [V_N, V_E, 0]"

    def water(self, positions: Mapping[str, Signal]) -> tuple[Signal, Signal, Signal]:
        """The current in body axes."""
        return stream(positions, self.V_N, self.V_E)


def stream(positions: Mapping[str, Signal], north: Signal, east: Signal) -> tuple[Signal, Signal, Signal]:
    """Velocity of water that flows `north` and `east` (m/s) in the axes of a body at the attitude `positions`."""
    phi, theta, psi = (positions[name] for name in ("phi", "theta", "psi"))
    xp = namespace(psi, north)
    ahead = north * xp.cos(psi) + east * xp.sin(psi)
    across = east * xp.cos(psi) - north * xp.sin(psi)
    v = ahead * xp.sin(theta) * xp.sin(phi) + across * xp.cos(phi)
    w = ahead * xp.sin(theta) * xp.cos(phi) - across * xp.sin(phi)
    return ahead * xp.cos(theta), v, w


def wave_band(duration: float, sample_interval: float) -> tuple[float, float]:
    """Frequencies (rad/s) of waves that runs of `duration` (s) can show, sampled every `sample_interval` (s).

    From two periods in a run to four samples in a period. Waves of the sea that push a vehicle have periods below half
    a minute; what is slower is no wave. Source: Munk (1950), Proc. 1st Conf. Coastal Eng., fig. 1.
    """
    return max(4.0 * np.pi / duration, 2.0 * np.pi / _LONGEST_PERIOD), 0.5 * np.pi / sample_interval


class WaveForcing(AbstractForce):
    r"""A regular wave in one equation: $\tau_i = a\cos\omega t + b\sin\omega t$.

    $\omega > 0$ is the frequency of encounter, rad/s. The time is each run's own, so runs in one sea need amplitudes of
    their own: fit them one by one.
    Source: Fossen (2021), §10.2; Faltinsen (1990).
    """

    name: ClassVar[str] = "wave-forcing"
    family: ClassVar[str] = "environment"
    equation: str = eqx.field(static=True)
    a: Array = amplitude("1")
    b: Array = amplitude("1")
    omega: Array = shape("rad/s", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[WaveForcing]":
        """Each free equation of a body at the frequencies that stand out of what the model misses in it."""
        if facts.kind != "submerged-body":
            return []
        return [cls(e, omega=number(w)) for e in facts.equations for w in facts.tones.get(e, ())]

    @classmethod
    def looked_at(cls, facts: Facts) -> int:
        """Every frequency of every equation."""
        return len(facts.equations) * facts.frequencies

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    def symbols(self) -> dict[str, str]:
        """`Y_cos`, `Y_sin` and `omega`."""
        return {"a": f"{FORCES[self.equation]}_cos", "b": f"{FORCES[self.equation]}_sin", "omega": "omega"}

    def units(self) -> dict[str, str]:
        """A force or a moment, and a frequency."""
        return {"a": unit_per(self.equation), "b": unit_per(self.equation), "omega": "rad/s"}

    @property
    def expression(self) -> str:
        """The wave."""
        return f"{FORCES[self.equation]}_cos cos(ωt) + {FORCES[self.equation]}_sin sin(ωt)"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The wave along the run."""
        angle = self.omega * motion.time + 0.0 * motion.rates[self.equation]
        xp = namespace(angle)
        return {self.equation: self.a * xp.cos(angle) + self.b * xp.sin(angle)}
