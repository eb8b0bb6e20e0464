"""A user's equations as a vehicle."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...arrays import Values, namespace
from ...effects import AbstractActuation, AbstractEffect, Motion, Signal
from ...parameters import number
from ..base import AbstractVehicle, Layout, timed
from ..sensors.sensors import Sensors
from .model import Model, numbers_of


class Equations(AbstractActuation):
    """The rates of a model along a motion, all together and what each input makes of them."""

    model: Model

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The rate of each state."""
        return self.model.rates(motion.positions, motion.actuators, motion.time)

    def force_of(self, name: str, motion: Motion) -> dict[str, Signal]:
        """What the rates are with the input `name` less what they are without it."""
        idle = motion.actuators | {name: 0.0 * motion.actuators[name]}
        without = self.force(dataclasses.replace(motion, actuators=idle))
        return {state: rate - without[state] for state, rate in self.force(motion).items()}


class OwnModel(AbstractVehicle):
    r"""$\dot x = f(x, u, t)$: each state is an equation of its own, of inertia 1 and without linear damping.

    A generalised force on the equation of a state is a rate of that state.

    **Fields**

    - `model`: the user's equations with their numbers.
    - `sensors`: scales and offsets of what is measured.
    - `spreads`: standard deviations between runs of numbers that differ by run.
    """

    model: Model
    layout: Layout = eqx.field(static=True)
    effects: tuple[AbstractEffect, ...] = ()
    sensors: Sensors = eqx.field(default_factory=Sensors)
    spreads: dict[str, Array] = eqx.field(default_factory=dict)

    def mass_matrix(self) -> Float[Values, "n n"]:
        """One for each state."""
        return self._library.eye(len(self.layout.equations), dtype=jnp.result_type(float))

    def damping_matrix(self) -> Float[Values, "n n"]:
        """None: what damps is among the rates."""
        return self._library.zeros((len(self.layout.equations),) * 2, jnp.result_type(float))

    @property
    def _library(self) -> Any:
        return namespace(*jax.tree.leaves(self.model))

    def own_values(self) -> dict[str, Array]:
        """The model's numbers, and the scales and offsets of sensors."""
        return {f.name: getattr(self.model, f.name) for f in numbers_of(type(self.model))} | self.sensors.numbers

    def with_own_values(self, values: Mapping[str, Values]) -> Self:
        """The same model with other numbers for those named."""
        names = [field.name for field in numbers_of(type(self.model))]
        changed = {name: number(values.get(name, getattr(self.model, name))) for name in names}
        model = dataclasses.replace(self.model, **changed)
        return dataclasses.replace(self, model=model, sensors=self.sensors.with_values(values))

    def motion(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Motion:
        """States by name, as rates and as positions."""
        states: dict[str, Signal] = {name: state[..., i] for i, name in enumerate(self.layout.states)}
        columns, time = timed(self.layout, signals, state[..., 0])
        names = [name for name, _ in self.layout.inputs]
        around = [name for name, _ in self.layout.environment]
        actuators, surroundings = columns[: len(names)], columns[len(names) :]
        return Motion(
            {e: states[e] for e in self.layout.equations},
            states,
            dict(zip(names, actuators, strict=True)),
            dict(zip(around, surroundings, strict=True)),
            self.mass_matrix(),
            0.0,
            0.0,
            time,
            actuation=self.actuation,
            first_order=True,
        )

    def own_force(self, motion: Motion) -> dict[str, Signal]:
        """The rates of the states."""
        return dict(Equations(self.model).force(motion))

    @property
    def fixed_gains(self) -> tuple[str, ...]:
        """All: which number scales an input is not known, so the recordings tell whether one does."""
        return tuple(name for name, _ in self.layout.inputs)

    @property
    def actuation(self) -> Equations:
        """By input."""
        return Equations(self.model)

    @property
    def linear(self) -> frozenset[str]:
        """None."""
        return frozenset()

    @property
    def nonlinear(self) -> tuple[Any, ...]:
        """All rates."""
        return (Equations(self.model),)

    def own_position_rates(self, motion: Motion) -> dict[str, Signal]:
        """None of its own."""
        return {}

    def channels(self, motion: Motion) -> dict[str, Signal]:
        """The states, and what the model shows beside them."""
        states = {name: motion.positions[name] for name in self.layout.equations}
        return states | self.model.shown(motion.positions, motion.actuators, motion.time)
