"""Sensor effects of how and where a sensor sits in the body."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .base import AbstractSensor, amplitude
from .motion import EQUATIONS, VELOCITIES, Facts, Motion, Signal

_TRIADS = (("u", "v", "w"), ("p", "q", "r"), ("ax", "ay", "az"))
_EQUATIONS = {velocity: equation for equation, velocity in VELOCITIES.items()}
# the turning rates that move a sensor off the axis, by channel and axis
_TURNS = {
    "u": {"y": "r", "z": "q"}, "v": {"x": "r", "z": "p"}, "w": {"x": "q", "y": "p"},
    "x": {"x": "r", "y": "r", "z": "q"}, "y": {"x": "r", "y": "r", "z": "p"},
    "z": {"x": "q", "y": "p"}, "depth": {"x": "q", "y": "p"},
    "ax": {"x": "r", "y": "r", "z": "q"}, "ay": {"x": "r", "y": "r", "z": "p"}, "az": {"x": "q", "y": "p", "z": "q"},
}  # fmt: skip


class SensorMisalignment(AbstractSensor):
    r"""A sensor that is turned in its mounting and so sees something of another axis: $z = y + \varepsilon\,y_{other}$.

    $\varepsilon$ in rad, of either sign, small. Of an attitude it is a bias, which is another effect.
    Source: Titterton and Weston (2004), §4; Groves (2013), §4.4.
    """

    name: ClassVar[str] = "sensor-misalignment"
    family: ClassVar[str] = "sensors"
    channel: str = eqx.field(static=True)
    sees: str = eqx.field(static=True)
    epsilon: Array = amplitude("rad")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorMisalignment]":
        """Each velocity, rate and specific force of a body with the other two axes, where these move and are known."""
        free = [VELOCITIES[e] for e in facts.equations] if facts.kind == "submerged-body" else []
        known = [*free, *(c for c in facts.channels if c in _TRIADS[2])] if free else []
        triads = [(c, triad) for c in facts.channels for triad in _TRIADS if c in triad]
        return [cls(c, other) for c, triad in triads for other in triad if other != c and other in known]

    @property
    def expression(self) -> str:
        """The cross-talk."""
        return f"{self.channel} measured = {self.channel} + ε {self.sees}"

    def measure(self, times: Float[Array, " *k"], outputs: Mapping[str, Signal], motion: Motion) -> Float[Array, " *k"]:
        """The output with a little of the other axis."""
        rates = {velocity: motion.rates[equation] for velocity, equation in _EQUATIONS.items()}
        return jnp.asarray(outputs[self.channel] + self.epsilon * (rates | dict(outputs))[self.sees])


class SensorLeverArm(AbstractSensor):
    r"""A sensor that sits a distance $l$ (m, either sign) along a body axis from where the model has it.

    A velocity sensor shows $\nu_1 + \nu_2\times l$, a position or depth sensor $\eta_1 + R\,l$, an accelerometer
    $f + \dot\nu_2\times l + \nu_2\times(\nu_2\times l)$. Source: Titterton and Weston (2004), §3; Groves (2013), §6.4.
    """

    name: ClassVar[str] = "sensor-lever-arm"
    family: ClassVar[str] = "sensors"
    channel: str = eqx.field(static=True)
    axis: str = eqx.field(static=True)
    arm: Array = amplitude("m")

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[SensorLeverArm]":
        """Each velocity, position and specific force of a body with the axes along which an arm shows."""
        free = [VELOCITIES[e] for e in facts.equations] if facts.kind == "submerged-body" else []
        arms = {channel: _TURNS.get(channel, {}) for channel in facts.channels}
        return [cls(channel, axis) for channel, turns in arms.items() for axis, rate in turns.items() if rate in free]

    @property
    def expression(self) -> str:
        """The motion of the sensor about the origin."""
        if self.channel in _TRIADS[0]:
            return f"{self.channel} measured = {self.channel} + (ν2 × l_{self.axis})"
        if self.channel in _TRIADS[2]:
            return f"{self.channel} measured = {self.channel} + (dν2/dt × l_{self.axis} + ν2 × (ν2 × l_{self.axis}))"
        return f"{self.channel} measured = {self.channel} + (R l_{self.axis})"

    def measure(self, times: Float[Array, " *k"], outputs: Mapping[str, Signal], motion: Motion) -> Float[Array, " *k"]:
        """The output where the sensor is."""
        return jnp.asarray(outputs[self.channel] + self.arm * self._per_metre(motion))

    def _per_metre(self, motion: Motion) -> Signal:
        unit = jnp.eye(3)["xyz".index(self.axis)]
        turning = jnp.stack(jnp.broadcast_arrays(*(motion.rates[e] for e in EQUATIONS[3:])), -1)
        moved = jnp.cross(turning, jnp.broadcast_to(unit, turning.shape))
        if self.channel in _TRIADS[0]:
            return moved[..., _TRIADS[0].index(self.channel)]
        if self.channel in _TRIADS[2]:
            still = jnp.zeros_like(turning[..., 0])
            spin = jnp.stack([motion.accelerations.get(e, still) for e in EQUATIONS[3:]], -1)
            felt = jnp.cross(spin, jnp.broadcast_to(unit, spin.shape)) + jnp.cross(turning, moved)
            return felt[..., _TRIADS[2].index(self.channel)]
        return self._turned(motion)

    def _turned(self, motion: Motion) -> Signal:
        """Entry of R(φ, θ, ψ) by the position's row and the arm's column."""
        phi, theta, psi = (motion.positions[name] for name in ("phi", "theta", "psi"))
        level = {"x": jnp.cos(theta), "y": jnp.sin(theta) * jnp.sin(phi), "z": jnp.sin(theta) * jnp.cos(phi)}[self.axis]
        across = {"x": jnp.zeros_like(phi), "y": jnp.cos(phi), "z": -jnp.sin(phi)}[self.axis]
        if self.channel == "x":
            return level * jnp.cos(psi) - across * jnp.sin(psi)
        if self.channel == "y":
            return level * jnp.sin(psi) + across * jnp.cos(psi)
        return {"x": -jnp.sin(theta), "y": jnp.cos(theta) * jnp.sin(phi), "z": jnp.cos(theta) * jnp.cos(phi)}[self.axis]
