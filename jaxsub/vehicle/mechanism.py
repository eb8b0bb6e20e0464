"""A mechanism of n coordinates: a rig, a roll decay, a servo."""

import dataclasses
from collections.abc import Mapping
from typing import Self

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import AbstractEffect, Motion, Signal
from ..parameters import number
from .actuation import RigActuation
from .base import AbstractVehicle, Layout, timed
from .sensors.sensors import Sensors


class Mechanism(AbstractVehicle):
    r"""$\sum_j I_{ij}\ddot q_j + D_{ij}\dot q_j + K_{ij}q_j = \sum_a B_{ia}u_a + F_i$ for n coordinates q.

    Names: `I_q`, `D_q`, `K_q` on the diagonal, `I_q_s`, `D_q_s`, `K_q_s` off it; `B_q_drive` for the actuator `drive`;
    `F_q` for a constant. Absent means 0, for `I_q` 1. A coupling given on one side only (`D_q_s`) stands for its twin
    (`D_s_q`) too, so it acts on both equations; `D_s_q = 0` beside it leaves the one.

    **Fields**

    - `coefficients`: SI, or any consistent units where the inertia is scaled to 1.
    - `sensors`: scales and offsets of what is measured.
    - `spreads`: standard deviations between runs of numbers that differ by run.
    """

    coefficients: dict[str, Float[Array, ""]]
    layout: Layout = eqx.field(static=True)
    effects: tuple[AbstractEffect, ...] = ()
    sensors: Sensors = eqx.field(default_factory=Sensors)
    spreads: dict[str, Array] = eqx.field(default_factory=dict)

    def mass_matrix(self) -> Float[Values, "n n"]:
        """I."""
        return self._matrix("I", diagonal=1.0)

    def damping_matrix(self) -> Float[Values, "n n"]:
        """-D."""
        return -self._matrix("D")

    def own_values(self) -> dict[str, Array]:
        """The coefficients, and the scales and offsets of sensors."""
        return self.coefficients | self.sensors.numbers

    def with_own_values(self, values: Mapping[str, Values]) -> Self:
        """The same mechanism with other coefficients for those named."""
        updated = {name: number(values.get(name, old)) for name, old in self.coefficients.items()}
        return dataclasses.replace(self, coefficients=updated, sensors=self.sensors.with_values(values))

    def motion(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Motion:
        """Rates and positions by coordinate."""
        equations, n = self.layout.equations, len(self.layout.equations)
        rates: dict[str, Signal] = {e: state[..., i] for i, e in enumerate(equations)}
        positions: dict[str, Signal] = {name: state[..., n + i] for i, name in enumerate(self.layout.positions)}
        columns, time = timed(self.layout, signals, state[..., 0])
        names = [name for name, _ in self.layout.inputs]
        environment = [name for name, _ in (*self.layout.prescribed, *self.layout.environment)]
        actuators = dict(zip(names, columns[: len(names)], strict=True))
        surroundings = dict(zip(environment, columns[len(names) :], strict=True))
        return Motion(
            rates, positions, actuators, surroundings, self.mass_matrix(), 0.0, 0.0, time,
            actuation=self.actuation,
        )  # fmt: skip

    def own_force(self, motion: Motion) -> dict[str, Signal]:
        """Springs, drives and constants."""
        stiffness, total = self._matrix("K"), {}
        for i, e in enumerate(self.layout.equations):
            spring = sum(stiffness[i, j] * motion.positions[s] for j, s in enumerate(self.layout.equations))
            drive = sum(self._value(f"B_{e}_{a}") * signal for a, signal in motion.actuators.items())
            total[e] = self._value(f"F_{e}") - spring + drive
        return total

    @property
    def fixed_gains(self) -> tuple[str, ...]:
        """The inputs of which not every `B_q_input` is free."""
        free = {row.name for row in self.layout.free}
        return tuple(a for a, own in self._drives.items() if not {f"B_{e}_{a}" for e in own} <= free)

    @property
    def actuation(self) -> RigActuation:
        """By coordinate."""
        return RigActuation(self._drives)

    @property
    def linear(self) -> frozenset[str]:
        """I and D."""
        return frozenset(name for name in self.coefficients if name.startswith(("I_", "D_")))

    def own_position_rates(self, motion: Motion) -> dict[str, Signal]:
        """The rates themselves."""
        return motion.rates

    def channels(self, motion: Motion) -> dict[str, Signal]:
        """Each coordinate `q` and its rate `q_rate`."""
        coordinates = {name: motion.positions[name] for name in self.layout.equations}
        return coordinates | {f"{name}_rate": rate for name, rate in motion.rates.items()}

    @property
    def _drives(self) -> dict[str, dict[str, Array]]:
        """B by actuator and coordinate, of those that there are."""
        inputs, equations, values = self.layout.inputs, self.layout.equations, self.coefficients
        found = {a: {e: values[f"B_{e}_{a}"] for e in equations if f"B_{e}_{a}" in values} for a, _ in inputs}
        return {a: own for a, own in found.items() if own}

    def _value(self, name: str) -> Values:
        return self.coefficients.get(name, np.zeros(()))

    def _matrix(self, letter: str, diagonal: float = 0.0) -> Float[Values, "n n"]:
        equations = self.layout.equations
        entry = lambda i, j: self.coefficients.get(f"{letter}_{i}_{j}", self._value(f"{letter}_{j}_{i}"))
        own = lambda i: self.coefficients.get(f"{letter}_{i}", np.asarray(diagonal))
        stack = namespace(*self.coefficients.values()).stack
        return stack([stack([own(i) if i == j else entry(i, j) for j in equations]) for i in equations])
