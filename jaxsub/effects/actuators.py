"""Actuator effects with a memory: lag, delay, limited rate and play between a command and a deflection.

An actuator does not feel the vehicle, so its answer is a function of the command's history alone and is worked out
before the vehicle is integrated, at the start, middle and end of every sample interval.
"""

import math
from collections.abc import Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..parameters import number
from .base import AbstractActuator, shape
from .motion import Facts

_GRID = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
# of the largest command
PARTS = (0.02, 0.05, 0.1, 0.2, 0.4)


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
        return _followed(self, times, nodes, nodes[:1, 0])

    def remembered(self, interval: float) -> int:
        """The deflection."""
        return 1

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The deflection fades towards the command."""
        # over half an interval, and squared: a square root has no derivative where a short lag has faded to zero
        fade = jnp.exp(-0.5 * interval / jnp.maximum(self.T, 1e-6))
        held, command = memory[0], nodes[0]
        start, end = held, command + (held - command) * fade**2
        middle = command + (held - command) * fade
        return end[None], jnp.stack([start, middle, end])


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

    def remembered(self, interval: float) -> int:
        """The commands of the dead time, whole intervals of it."""
        return math.ceil(max(float(self.tau), 0.0) / interval)

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The last interval of a record that begins with the commands remembered."""
        commands = jnp.concatenate([memory, nodes[:1]])
        times = interval * jnp.arange(len(commands) + 1, dtype=nodes.dtype)
        return commands[1:], self.respond(times, jnp.broadcast_to(commands[:, None], (len(commands), 3)))[-1]


class ActuatorRateLimit(AbstractActuator):
    r"""Limited rate: $|\dot\delta| \le R$, $R > 0$ in the actuator's unit per s.

    Each interval gets the line with the mean and the slope of the ramp towards the held command, which has a derivative
    in $R$ and leaves a command that is never limited as it is. The actuator starts at its first command.
    Source: Fossen (2021), §9.5.
    """

    name: ClassVar[str] = "actuator-rate-limit"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    rate: Array = shape("1/s", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorRateLimit]":
        """Each actuator with rates at which its largest step takes from 1.5 to 24 samples."""
        fastest = {name: facts.input_range[name][2] for name in facts.actuators if name in facts.input_range}
        return [cls(name, number(R / n)) for name, R in fastest.items() if R > 0.0 for n in (1.5, 3.0, 6.0, 12.0, 24.0)]

    @property
    def expression(self) -> str:
        """The limit."""
        return f"|d({self.actuator})/dt| <= R"

    def symbols(self) -> dict[str, str]:
        """`R`."""
        return {"rate": "R"}

    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """The limited deflection."""
        return _followed(self, times, nodes, _mean(nodes[0])[None])

    def remembered(self, interval: float) -> int:
        """The deflection."""
        return 1

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The deflection goes towards the command's mean: an actuator before this one may have bent it."""
        held, reach = memory[0], jnp.maximum(self.rate, 1e-9) * interval
        ahead = _mean(nodes) - held
        moved = jnp.clip(ahead, -reach, reach)
        part = jnp.minimum(jnp.abs(ahead) / reach, 1.0)  # of the interval, until the command is reached
        mean, slope = held + moved * (1.0 - 0.5 * part), moved * part * (3.0 - 2.0 * part)
        return (held + moved)[None], jnp.stack([mean - 0.5 * slope, mean, mean + 0.5 * slope])


class ActuatorBacklash(AbstractActuator):
    r"""Play in the linkage: the deflection stands still until the command has crossed the gap $2b$, $b \ge 0$.

    $\delta \leftarrow \min(\max(\delta, \delta_{cmd} - b), \delta_{cmd} + b)$; it starts at its first command.
    Source: Tao and Kokotovic (1996), §2; Fossen (2021), §9.5.
    """

    name: ClassVar[str] = "actuator-backlash"
    family: ClassVar[str] = "actuators"
    actuator: str = eqx.field(static=True)
    b: Array = shape("1", sign=+1, default=0.01)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[ActuatorBacklash]":
        """Each actuator with gaps of a few to forty per cent of its largest command."""
        return [cls(name, number(part * size)) for name, size in facts.largest_commands.items() for part in PARTS]

    @property
    def expression(self) -> str:
        """The play."""
        return f"|command - {self.actuator}| <= b, at rest inside"

    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """The deflection behind the play."""
        return _followed(self, times, nodes, nodes[:1, 0])

    def remembered(self, interval: float) -> int:
        """The deflection."""
        return 1

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The deflection is taken along by the command."""
        gap, held, after = jnp.maximum(self.b, 0.0), memory[0], []
        for command in nodes:
            held = jnp.clip(held, command - gap, command + gap)
            after.append(held)
        return held[None], jnp.stack(after)


def _followed(
    effect: AbstractActuator, times: Float[Array, " k"], nodes: Float[Array, "k1 3"], memory: Float[Array, " m"]
) -> Float[Array, "k1 3"]:
    """What an actuator does that goes on from one interval to the next, from its `memory` at the start."""
    on = lambda held, part: effect.advance(held, *part)
    return jax.lax.scan(on, memory, (nodes, jnp.diff(times)))[1]


def _mean(nodes: Float[Array, "3"]) -> Float[Array, ""]:
    """Over the interval, of the parabola through the nodes."""
    return nodes @ jnp.array([1.0, 4.0, 1.0]) / 6.0
