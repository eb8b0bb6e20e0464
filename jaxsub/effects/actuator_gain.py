"""An actuator whose force is weaker or stronger than modelled."""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from .base import AbstractForce, amplitude
from .motion import Facts, Motion, Signal

# 1σ of the gain before the data: pairs of one make differ by a few per cent, fouled or chipped ones by tens
_SPREAD = 0.2


class ActuatorGain(AbstractForce):
    r"""Loss of effectiveness: the force of an actuator is $(1 + g)$ times the modelled one, $-1 \le g \le 1$.

    $\tau \mathrel{+}= g\,\tau_a$, with $\tau_a$ all that the model has of the actuator: of one under `[actuators]` its
    force, of another input that of all coefficients by it. $g < 0$ is a fouled, damaged or worn one, $-1$ one that is
    lost. Where the vehicle's own free coefficients scale that force already, no recording can tell both apart, and the
    effect is no candidate.
    Source: Omerdic and Roberts (2004), Control Eng. Practice 12; Zhang and Jiang (2008), Annu. Rev. Control 32.
    """

    name: ClassVar[str] = "actuator-gain"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    gain: Array = amplitude("1", most=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorGain]":
        """Each actuator whose force no free number of the vehicle scales."""
        return [cls(name) for name in facts.fixed_gains]

    @property
    def where(self) -> tuple[str, ...]:
        """The actuator."""
        return (f"input:{self.actuator}",)

    @property
    def expression(self) -> str:
        """The factor."""
        return f"force of {self.actuator} = (1 + g) modelled force"

    def symbols(self) -> dict[str, str]:
        """`g`."""
        return {"gain": "g"}

    def prior_std(self) -> dict[str, float]:
        """A fifth of the force."""
        return {"gain": _SPREAD}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The part of the actuator's force along the motion. **Raises** `KeyError` for one that the model lacks."""
        if motion.actuation is None:
            raise KeyError(self.actuator)
        return {e: self.gain * part for e, part in motion.actuation.force_of(self.actuator, motion).items()}
