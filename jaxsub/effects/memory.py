"""Forces that remember: they carry a state of their own, which the vehicle integrates with its positions."""

import abc
import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..parameters import number
from ..programs import compiled
from .base import AbstractForce, amplitude, shape, stacked
from .motion import FORCES, Facts, Motion, Signal, unit_per

# what of a motion changes along a run
_MOVING = ("rates", "positions", "actuators", "environment", "water", "buoyancy", "cruise", "time")


class AbstractMemory(AbstractForce):
    """A force with states of its own, by name among `Motion.positions`; they start at zero."""

    @property
    @abc.abstractmethod
    def states(self) -> tuple[str, ...]:
        """Names of the states, which no other effect on the vehicle may have."""

    @abc.abstractmethod
    def memory_rates(self, motion: Motion) -> dict[str, Signal]:
        """Rate of each state along `motion`, per s."""


class FluidMemory(AbstractMemory):
    r"""Hull force that lags behind the motion, as of shed vortices: $\tau_i = c\,m$, $T_m\dot m = (\nu_i - m)$.

    $\nu_i$ is the velocity beside the operating speed, $T_m > 0$ in s. $c \le 0$: then it takes power out of any motion
    that starts at rest. Source: Cummins (1962); Fossen (2021), §5.4, with one state.
    """

    name: ClassVar[str] = "fluid-memory"
    family: ClassVar[str] = "hull"
    equation: str = eqx.field(static=True)
    c: Array = amplitude("1", sign=-1)
    T_m: Array = shape("s", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[FluidMemory]":
        """Each free equation of a body with times from two samples up."""
        free = facts.equations if facts.kind == "submerged-body" else ()
        times = [n * facts.sample_interval for n in (2.0, 5.0, 10.0, 20.0, 50.0)]
        return [cls(e, T_m=number(T)) for e in free for T in times]

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.equation,)

    @property
    def states(self) -> tuple[str, ...]:
        """The lagged velocity."""
        return (f"memory_{self.equation}",)

    def symbols(self) -> dict[str, str]:
        """SNAME symbol such as `Y_memory`, and `T_m`."""
        return {"c": f"{FORCES[self.equation]}_memory", "T_m": "T_m"}

    def units(self) -> dict[str, str]:
        """Force per velocity, and a time."""
        return {"c": unit_per(self.equation, self.equation), "T_m": "s"}

    @property
    def expression(self) -> str:
        """The force."""
        return f"{FORCES[self.equation]}_memory m, T_m dm/dt = {self.equation} velocity - m"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The lagged force along the motion."""
        return {self.equation: self.c * motion.positions[self.states[0]]}

    def memory_rates(self, motion: Motion) -> dict[str, Signal]:
        """First-order lag of the velocity."""
        steady = motion.cruise if self.equation == "surge" else 0.0
        behind = motion.flow[self.equation] - steady - motion.positions[self.states[0]]
        return {self.states[0]: behind / jnp.maximum(self.T_m, 1e-6)}


class Hysteresis(AbstractMemory):
    r"""Friction that bends before it slips (Bouc and Wen): $F = -F_h z$, $F_h \ge 0$, $x_y > 0$ the yield distance.

    $\dot z = [\dot q - \tfrac12(|\dot q|z + \dot q|z|)]/x_y$, which keeps $|z| \le 1$.
    Source: Bouc (1967); Wen (1976); Ikhouane and Rodellar (2007), normalised with n = 1 and $\sigma = ½$.
    """

    name: ClassVar[str] = "hysteresis"
    family: ClassVar[str] = "mechanisms"
    equation: str = eqx.field(static=True)
    F_h: Array = amplitude("1", sign=+1)
    x_y: Array = shape("1", sign=+1, default=1.0)

    @classmethod
    def candidates(cls, facts: Facts) -> "Sequence[Hysteresis]":
        """Each coordinate of a mechanism, with yield distances up to half of how far it went."""
        parts = (0.02, 0.05, 0.1, 0.2, 0.5)
        return [cls(e, x_y=number(part * far)) for e, far in facts.travel.items() for part in parts]

    @property
    def where(self) -> tuple[str, ...]:
        """The one coordinate."""
        return (self.equation,)

    @property
    def states(self) -> tuple[str, ...]:
        """The share of the friction that is there."""
        return (f"hysteresis_{self.equation}",)

    @property
    def expression(self) -> str:
        """The force."""
        return f"-F_h z, dz/dt = ({self.equation}' - ½(|{self.equation}'| z + {self.equation}' |z|)) / x_y"

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The friction along the motion."""
        return {self.equation: -self.F_h * motion.positions[self.states[0]]}

    def memory_rates(self, motion: Motion) -> dict[str, Signal]:
        """Bouc and Wen's equation."""
        rate, z = motion.rates[self.equation], motion.positions[self.states[0]]
        return {self.states[0]: (rate - 0.5 * (abs(rate) * z + rate * abs(z))) / jnp.maximum(self.x_y, 1e-9)}


def with_memories(
    effects: Sequence[AbstractMemory], start: Motion, end: Motion, steps: Signal
) -> list[tuple[Motion, Motion]]:
    """For each of `effects` a motion at both ends of every interval, the effect's states filled in, from zero.

    `start` and `end` are the motion at the ends, whose leaves that change have the shape (R, K-1) of `steps`, the
    length of each interval in s, 0 where padded. Between the ends a motion is taken for a line; the states go over each
    interval by the classical Runge-Kutta step.
    """
    alike = stacked(effects)
    made = _remembered([stack for _, stack in alike], start, end, steps) if alike else []
    found: list[Any] = [None] * len(effects)
    for (own, _), ends in zip(alike, made, strict=True):
        for place, index in enumerate(own):
            before, after = jax.tree.map(lambda leaf, place=place: np.asarray(leaf)[place], ends)
            filled = lambda motion, states: dataclasses.replace(motion, positions=motion.positions | states)
            found[index] = filled(start, before), filled(end, after)
    return found


@compiled
def _remembered(
    stacks: list[AbstractMemory], start: Motion, end: Motion, steps: Signal
) -> list[tuple[dict[str, Array], dict[str, Array]]]:
    """The states of all effects of each stack, one program for all of them."""
    return [jax.vmap(lambda effect: _states(effect, start, end, steps))(stack) for stack in stacks]


def _states(
    effect: AbstractMemory, start: Motion, end: Motion, steps: Signal
) -> tuple[dict[str, Array], dict[str, Array]]:
    """The states at both ends of every interval, (R, K-1) each."""

    def moving(motion: Motion) -> dict:
        spread = lambda leaf: jnp.moveaxis(jnp.broadcast_to(leaf, steps.shape), -1, 0)
        return jax.tree.map(spread, {name: getattr(motion, name) for name in _MOVING})

    def rates(held: dict[str, Array], parts: dict) -> dict[str, Signal]:
        parts = parts | {"positions": parts["positions"] | held}
        return effect.memory_rates(dataclasses.replace(start, **parts))

    def advance(held: dict[str, Array], interval: tuple[dict, dict, Array]) -> tuple[dict, tuple[dict, dict]]:
        first, last, step = interval
        middle = jax.tree.map(lambda a, b: 0.5 * (a + b), first, last)
        move = lambda by, part: {name: held[name] + part * step * rate for name, rate in by.items()}
        k1 = rates(held, first)
        k2 = rates(move(k1, 0.5), middle)
        k3 = rates(move(k2, 0.5), middle)
        k4 = rates(move(k3, 1.0), last)
        after = move({name: (k1[name] + 2.0 * (k2[name] + k3[name]) + k4[name]) / 6.0 for name in held}, 1.0)
        return after, (held, after)

    origin = {name: jnp.zeros(steps.shape[:-1], steps.dtype) for name in effect.states}
    intervals = (moving(start), moving(end), jnp.moveaxis(steps, -1, 0))
    return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, 0, -1), jax.lax.scan(advance, origin, intervals)[1])
