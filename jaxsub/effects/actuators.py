"""Actuator effects: what stands between a command and a deflection.

An actuator does not feel the vehicle, so its answer is a function of the command's history alone and is worked out
before the vehicle is integrated, at the start, middle and end of every sample interval.
"""

from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..parameters import number
from .base import AbstractActuator, shape
from .motion import Facts

_GRID = (0.5, 1.0, 2.0, 4.0, 8.0)


def _grid(facts: Facts) -> list[float]:
    """Times worth trying, from half a sample up: shorter ones leave no trace in the record."""
    return [factor * facts.sample_interval for factor in _GRID]


class ActuatorLag(AbstractActuator):
    r"""First-order lag: $T\dot\delta = \delta_{cmd} - \delta$, $T > 0$ in s.

    Exact for the held command: over an interval $\delta(s) = \delta_{cmd} + (\delta_k - \delta_{cmd})e^{-s/T}$.
    Source: Fossen (2021), §9.5; Healey and Lienard (1993).
    """

    name: ClassVar[str] = "actuator-lag"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    T: Array = shape("s", sign=+1, default=0.1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorLag]":
        """Each actuator with each time constant of a grid."""
        return [cls(name, number(T)) for name in facts.actuators for T in _grid(facts)]

    @property
    def expression(self) -> str:
        """The lag."""
        return f"T d({self.actuator})/dt = command - {self.actuator}"

    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """The lagged deflection; the actuator starts at rest at its first command."""
        # over half an interval, and squared: a square root has no derivative where a short lag has faded to zero
        decay = jnp.exp(-0.5 * jnp.diff(times) / jnp.maximum(self.T, 1e-6))

        def interval(held: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
            command, fade = step
            start, end = held, command + (held - command) * fade**2
            middle = command + (held - command) * fade
            return end, jnp.stack([start, middle, end])

        return jax.lax.scan(interval, nodes[0, 0], (nodes[:, 0], decay))[1]


class ActuatorDelay(AbstractActuator):
    r"""Dead time: $\delta(t) = \delta_{cmd}(t - \tau)$, $\tau \ge 0$ in s.

    Each interval gets the mean of the shifted, held command, which has a derivative in $\tau$ and keeps the impulse.
    Source: Åström and Wittenmark (1997), §2.
    """

    name: ClassVar[str] = "actuator-delay"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    tau: Array = shape("s", sign=+1, default=0.1)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorDelay]":
        """Each actuator with each delay of a grid."""
        return [cls(name, number(tau)) for name in facts.actuators for tau in _grid(facts)]

    @property
    def expression(self) -> str:
        """The delay."""
        return f"{self.actuator}(t) = command(t - τ)"

    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """Interval means of the delayed command, from the exact integral of the held command."""
        impulse = jnp.concatenate([jnp.zeros(1), jnp.cumsum(nodes[:, 0] * jnp.diff(times))])
        before = times[0] - jnp.maximum(self.tau, 0.0)
        # the command before the record is taken to be its first value
        grid = jnp.concatenate([before[None] - 1.0, times])
        integral = jnp.concatenate([(impulse[0] - nodes[0, 0] * (times[0] - before + 1.0))[None], impulse])
        shifted = jnp.interp(times - jnp.maximum(self.tau, 0.0), grid, integral)
        mean = jnp.diff(shifted) / jnp.diff(times)
        return jnp.broadcast_to(mean[:, None], nodes.shape)
