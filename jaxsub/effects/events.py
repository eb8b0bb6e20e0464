"""What happens at some time in the run: a mass that shifts, thrust that is lost.

The time is that of each run's own clock, so of several runs every one has the event at the same time since its start.
"""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from ..arrays import namespace
from ..parameters import number
from .base import AbstractForce, amplitude, shape
from .hydrostatics import lift_moments
from .motion import Facts, Motion, Signal

_TIMES = 24


def _grid(facts: Facts) -> list[float]:
    """Times spread evenly over the longest run, none at its ends."""
    return [facts.duration * (i + 0.5) / _TIMES for i in range(_TIMES)] if facts.duration > 0.0 else []


def _since(motion: Motion, t_0: Signal | float, width: float) -> Signal | float:
    """From 0 to 1 about `t_0`, within about `width` s, so that there is a derivative in `t_0`."""
    late = (motion.time - t_0) / width
    return 0.5 * (1.0 + namespace(late).tanh(late))


class MassShift(AbstractForce):
    r"""Ballast, batteries or cargo that shift at $t_0$: the centre of gravity moves by $\Delta x_G$ or $\Delta y_G$, m.

    $\Delta x_G$: $M = -W\Delta x_G\cos\phi\cos\theta$, $N = W\Delta x_G\sin\phi\cos\theta$. $\Delta y_G$:
    $K = W\Delta y_G\cos\phi\cos\theta$, $N = W\Delta y_G\sin\theta$. $W$ is the displaced weight, either shift has
    either sign, $t_0 \ge 0$ in s; the inertia is left as it is. Source: Fossen (2021), §4.1.
    """

    name: ClassVar[str] = "mass-shift"
    family: ClassVar[str] = "hydrostatics"
    axis: str = eqx.field(static=True)
    width: float = eqx.field(static=True)
    shift: Array = amplitude("m")
    t_0: Array = shape("s", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[MassShift]":
        """The axes whose moment a free equation feels, at times over the run."""
        felt = {"x": "pitch", "y": "roll"} if facts.kind == "submerged-body" else {}
        axes = [axis for axis, equation in felt.items() if equation in facts.equations]
        return [cls(axis, facts.sample_interval, t_0=number(t)) for axis in axes for t in _grid(facts)]

    @property
    def where(self) -> tuple[str, ...]:
        """The equations that feel the moment, the most affected first."""
        return {"x": ("pitch", "yaw"), "y": ("roll", "yaw")}[self.axis]

    @property
    def label(self) -> str:
        """By its axis."""
        return f"{self.name}[{self.axis}]"

    def symbols(self) -> dict[str, str]:
        """`delta_x_G` or `delta_y_G`, and `t_0`."""
        return {"shift": f"delta_{self.axis}_G", "t_0": "t_0"}

    @property
    def expression(self) -> str:
        """The main moment."""
        return {"x": "M -= W Δx_G cosφ cosθ from t_0 on", "y": "K += W Δy_G cosφ cosθ from t_0 on"}[self.axis]

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The moments along the motion: weight pulls where lift pushes."""
        return lift_moments(motion, self.axis, -self.shift * motion.buoyancy * _since(motion, self.t_0, self.width))


class ThrustLoss(AbstractForce):
    r"""Thrust lost from $t_0$ on, to a fouled or damaged propeller: $X = -f\,s$ with s the recorded thrust, or
    $|n|n$ of the recorded shaft speed, or 1; $f \ge 0$, $t_0 \ge 0$ in s.

    Source: Smogeli (2006), §2.4.
    """

    name: ClassVar[str] = "thrust-loss"
    family: ClassVar[str] = "propulsion"
    of: str = eqx.field(static=True)
    width: float = eqx.field(static=True)
    loss: Array = amplitude("N", sign=+1)
    t_0: Array = shape("s", sign=+1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ThrustLoss]":
        """A body that is driven and free in surge, at times over the run; of a constant thrust where none is recorded.

        What ballast drives has no thrust to lose.
        """
        if facts.kind != "submerged-body" or "surge" not in facts.equations or not facts.driven:
            return []
        of = next((name for name in ("thrust", "shaft_speed") if name in facts.propulsion), "constant")
        return [cls(of, facts.sample_interval, t_0=number(t)) for t in _grid(facts)]

    @property
    def where(self) -> tuple[str, ...]:
        """Surge."""
        return ("surge",)

    def units(self) -> dict[str, str]:
        """A share of the thrust, a thrust coefficient or a force; a time."""
        return {"loss": {"thrust": "1", "shaft_speed": "N/(rad/s)/(rad/s)"}.get(self.of, "N"), "t_0": "s"}

    @property
    def expression(self) -> str:
        """The loss."""
        return {"thrust": "-f T", "shaft_speed": "-f |n| n"}.get(self.of, "-f") + " from t_0 on"

    def symbols(self) -> dict[str, str]:
        """`f` and `t_0`."""
        return {"loss": "f", "t_0": "t_0"}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The lost thrust along the motion."""
        lost = self.loss * _since(motion, self.t_0, self.width) + 0.0 * motion.rates["surge"]
        if self.of == "shaft_speed":
            return {"surge": -lost * abs(motion.actuators["shaft_speed"]) * motion.actuators["shaft_speed"]}
        return {"surge": -lost * motion.actuators["thrust"] if self.of == "thrust" else -lost}
