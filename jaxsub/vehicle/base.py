"""What every vehicle is to the rest of the house: named equations, states, signals and outputs, and effects on top."""

import abc
import dataclasses
from collections.abc import Callable, Collection, Mapping
from typing import Any, Self, TypeGuard

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..arrays import Values
from ..effects import (
    STANDARD_DENSITY,
    AbstractActuation,
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractInstrument,
    AbstractMemory,
    Motion,
    RunVariation,
    Signal,
    parameter_table,
    with_numbers,
)
from ..methods import jittable
from ..parameters import Parameter, number
from .description import described
from .layout import Layout, deviation
from .sensors.output import SPECIFIC_FORCE
from .sensors.sensors import Sensors
from .ties import followed
from .variation import sample_by_sample


class AbstractVehicle(eqx.Module):
    r"""Equations of motion $\tilde M\dot\nu = \tilde A\nu + \tau(\nu, \eta, \delta, t)$.

    $\tau$ is all that is not linear damping. A state is [ν of the free equations, positions], the states of effects
    with a memory last among the positions; signals are the columns of inputs, prescribed motions and surroundings in
    that order, and may end with the time (s), which is otherwise 0. All methods take any leading axes.

    Of a number that differs by run the vehicle has the mean, and among its positions each run's deviation from that,
    which stands still. `spreads` are the standard deviations between runs of such numbers by name, SI; NaN where that
    is still to be estimated.
    """

    layout: eqx.AbstractVar[Layout]
    effects: eqx.AbstractVar[tuple[AbstractEffect, ...]]
    sensors: eqx.AbstractVar[Sensors]
    spreads: eqx.AbstractVar[dict[str, Array]]

    def __repr__(self) -> str:
        return described(self.layout, self.values())

    @abc.abstractmethod
    def mass_matrix(self) -> Float[Values, "n n"]:
        """Inertia of the free equations."""

    @abc.abstractmethod
    def damping_matrix(self) -> Float[Values, "n n"]:
        r"""$\tilde A$ of the free equations."""

    @abc.abstractmethod
    def own_values(self) -> dict[str, Array]:
        """The vehicle's numbers by name, without its effects'."""

    @abc.abstractmethod
    def with_own_values(self, values: Mapping[str, Values]) -> Self:
        """The same vehicle with other numbers, the `values` (SI) by name."""

    @abc.abstractmethod
    def motion(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Motion:
        """The motion by name of `state` (*k, s) under `signals` (*k, m), SI."""

    @abc.abstractmethod
    def own_force(self, motion: Motion) -> dict[str, Signal]:
        """Generalised forces (N, N m) of `motion` but linear damping of the free equations and effects."""

    @property
    def has(self) -> frozenset[str]:
        """What it contains of what an effect could say (`Facts.has`): free scales and offsets of its sensors."""
        return frozenset(row.name for row in self.layout.free if row.name in self.sensors.numbers)

    @property
    def density(self) -> float:
        """Of the water that its numbers are for, kg/m³."""
        return STANDARD_DENSITY

    @property
    def speed(self) -> float:
        """The operating speed, m/s; zero of what has none."""
        return 0.0

    @property
    @abc.abstractmethod
    def fixed_gains(self) -> tuple[str, ...]:
        """The actuators whose force no free number of its own scales as a whole (`Facts.fixed_gains`)."""

    @property
    @abc.abstractmethod
    def actuation(self) -> AbstractActuation:
        """The forces of its own actuators, each by itself."""

    @property
    @abc.abstractmethod
    def linear(self) -> frozenset[str]:
        """The numbers that inertia and linear damping follow."""

    @property
    def aliases(self) -> dict[str, str]:
        """Names that expressions may have for numbers of effects, with the names of those numbers."""
        return {}

    @property
    def nonlinear(self) -> tuple[Any, ...]:
        """Parts of its own whose `force` of a motion is stepped explicitly and follows velocities."""
        return ()

    @abc.abstractmethod
    def own_position_rates(self, motion: Motion) -> dict[str, Signal]:
        """Rates (SI) of the position states in `motion`, without its effects'."""

    @abc.abstractmethod
    def channels(self, motion: Motion) -> dict[str, Signal]:
        """Every channel that the motion shows at the origin of the vehicle's axes, before any sensor."""

    def values(self) -> dict[str, Array]:
        """Every number by name, effects included."""
        named = dict(self.own_values())
        for effect in self.effects:
            named |= {row.name: getattr(effect, field) for field, row in parameter_table(effect).items()}
        return named

    def with_values(self, values: Mapping[str, Values]) -> Self:
        """The same vehicle with other numbers, `values` (SI) by name, and those that follow from them."""
        if self.layout.ties:
            every, names = {**self.values(), **values}, self.aliases
            every |= {alias: every[name] for alias, name in names.items()}
            for tie in self.layout.ties:
                every[tie.name] = tie.of(every)
            values = {**values, **{names.get(tie.name, tie.name): every[tie.name] for tie in self.layout.ties}}
        vehicle = self.with_own_values(values)
        effects = []
        for effect in self.effects:
            rows = parameter_table(effect)
            effects.append(with_numbers(effect, {f: values[r.name] for f, r in rows.items() if r.name in values}))
        return dataclasses.replace(vehicle, effects=tuple(effects))

    @property
    def all_effects(self) -> tuple[AbstractEffect, ...]:
        """Its effects, and the numbers that differ by run as such."""
        units = {row.name: row.unit for row in self.layout.parameters}
        return (*self.effects, *(RunVariation(n, units[n], spread=spread) for n, spread in self.spreads.items()))

    def with_effect(self, effect: AbstractEffect) -> Self:
        """The same vehicle with one effect more, its numbers free; or with a number that differs by run."""
        if isinstance(effect, RunVariation):
            return self._with_variations({**self.spreads, effect.number: effect.spread})
        layout = dataclasses.replace(
            self.layout, parameters=(*self.layout.parameters, *parameter_table(effect).values())
        )
        layout = dataclasses.replace(layout, positions=layout.positions + memory_states((effect,)))
        return dataclasses.replace(self, effects=(*self.effects, effect), layout=layout)

    def without_effect(self, label: str) -> Self:
        """The same vehicle less the effect of that label."""
        varied = {e.number for e in self.all_effects if isinstance(e, RunVariation) and e.label != label}
        if len(varied) < len(self.spreads):
            return self._with_variations({name: spread for name, spread in self.spreads.items() if name in varied})
        gone = {row.name for e in self.effects if e.label == label for row in parameter_table(e).values()}
        kept = tuple(e for e in self.effects if e.label != label)
        lost = {*memory_states(tuple(e for e in self.effects if e.label == label)), *map(deviation, gone)}
        layout = dataclasses.replace(
            self.layout,
            parameters=tuple(p for p in self.layout.parameters if p.name not in gone),
            positions=tuple(name for name in self.layout.positions if name not in lost),
        )
        spreads = {name: spread for name, spread in self.spreads.items() if name not in gone}
        return dataclasses.replace(self, effects=kept, layout=layout, spreads=spreads)

    def _with_variations(self, spreads: Mapping[str, Array]) -> Self:
        """The same vehicle, the numbers of `spreads` and no other differing by run."""
        rows = tuple(dataclasses.replace(row, varies=row.name in spreads) for row in self.layout.parameters)
        fixed = (name for name in self.layout.positions if name not in self.layout.deviations)
        positions = (*fixed, *(deviation(row.name) for row in rows if row.varies))
        layout = dataclasses.replace(self.layout, parameters=rows, positions=positions)
        return dataclasses.replace(self, layout=layout, spreads=dict(spreads))

    def with_spreads(self, spreads: Mapping[str, ArrayLike]) -> Self:
        """The same vehicle with other standard deviations between runs: `spreads` by name, SI."""
        return dataclasses.replace(self, spreads={n: number(spreads.get(n, old)) for n, old in self.spreads.items()})

    def of_run(self, positions: Mapping[str, Signal]) -> Self:
        """The vehicle with the numbers of the run of which `positions` are, one sample; itself where none differs."""
        if not self.spreads:
            return self
        values = self.values()
        own = {name: values[name] + positions[deviation(name)] for name in self.spreads}
        return dataclasses.replace(self.with_values(own), spreads={})

    @property
    def at_mean(self) -> Self:
        """The vehicle with the mean of numbers that differ by run for every run, and without the runs' deviations."""
        if not self.spreads:
            return self
        return dataclasses.replace(self, spreads={}, layout=self.layout.at_mean)

    def holding(self, names: Collection[str]) -> Self:
        """The same vehicle, the numbers of those `names` no longer free."""
        return self.with_freedom(dict.fromkeys(names, False))

    def with_freedom(self, free: Mapping[str, bool]) -> Self:
        """The same vehicle, the numbers that `free` names free or not; what it lacks of them is passed over."""
        return self.with_rows(lambda row: dataclasses.replace(row, free=free.get(row.name, row.free)))

    def with_rows(self, change: Callable[[Parameter], Parameter]) -> Self:
        """The same vehicle, each `Parameter` as `change` makes it."""
        layout = dataclasses.replace(self.layout, parameters=tuple(map(change, self.layout.parameters)))
        return dataclasses.replace(self, layout=layout)

    def position_rates(self, motion: Motion) -> dict[str, Signal]:
        """Rates (SI) of the position states in `motion`, effects included."""
        rates = self.own_position_rates(motion)
        for effect in self.effects:
            if isinstance(effect, AbstractMemory):
                rates = rates | effect.memory_rates(motion)
        still = jnp.zeros_like(motion.rates[self.layout.equations[0]])
        return rates | {deviation(name): still for name in self.spreads}

    @jittable
    def force(self, motion: Motion) -> Float[Array, "*k n"]:
        r"""All generalised forces (N, N m) other than linear damping, effects included.

        Of a run whose inertia $\tilde M_r$ or damping $\tilde A_r$ is its own
        $\tilde M\tilde M_r^{-1}(\tau_r + \tilde A_r\nu) - \tilde A\nu$, so that $\dot\nu$ is the run's.
        """
        if self.spreads:
            return sample_by_sample(self._force_of_run, motion.rates[self.layout.equations[0]].shape, motion)
        return self._force(motion)

    def _force_of_run(self, motion: Motion) -> Float[Array, " n"]:
        run, equations = self.of_run(motion.positions), self.layout.equations
        force = run._force(dataclasses.replace(motion, actuation=run.actuation))
        changed = {*self.spreads, *(n for n, ends in followed(self.layout.ties).items() if {*ends} & {*self.spreads})}
        if not changed & self.linear:
            return force
        velocity = stack(motion.rates, equations, motion.rates[equations[0]])
        rate = jnp.linalg.solve(run.mass_matrix(), force + run.damping_matrix() @ velocity)
        return self.mass_matrix() @ rate - self.damping_matrix() @ velocity

    def _force(self, motion: Motion) -> Float[Array, "*k n"]:
        total = self.own_force(motion)
        for effect in self.effects:
            if isinstance(effect, AbstractForce):
                for equation, part in effect.force(motion).items():
                    total[equation] = total.get(equation, 0.0) + part
        return stack(total, self.layout.equations, motion.rates[self.layout.equations[0]])

    def actuate(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3 m"]) -> Float[Array, "k1 3 m"]:
        """The signals at the start, middle and end of each interval, after the actuators.

        `times` (K,) are the samples, s, and `nodes` (K-1, 3, m) the commands, SI.
        """
        names = [name for name, _ in self.layout.inputs]
        nodes = self.true_inputs(nodes)
        for effect in self.effects:
            if isinstance(effect, AbstractActuator):
                column = names.index(effect.actuator)
                nodes = nodes.at[:, :, column].set(effect.respond(times, nodes[:, :, column]))
        return nodes

    def true_inputs(self, signals: Float[Array, "*k m"]) -> Float[Array, "*k m"]:
        """Recorded `signals`, the inputs among them as they were where their columns are scaled or offset."""
        for column, (name, _) in enumerate(self.layout.inputs):
            if self.sensors.corrects(name):
                signals = signals.at[..., column].set(self.sensors.true(name, signals[..., column]))
        return signals

    @jittable
    def acceleration(self, state: Float[Array, "*k s"], signals: Float[Array, "*k m"]) -> Float[Array, "*k n"]:
        r"""$\dot\nu$ of the free equations (m/s², rad/s²)."""
        n = len(self.layout.equations)
        force = self.force(self.motion(state, signals)) + state[..., :n] @ self.damping_matrix().T
        return force @ jnp.linalg.inv(self.mass_matrix()).T

    @jittable
    def measure(
        self, times: Float[Array, " *k"], state: Float[Array, "*k s"], signals: Float[Array, "*k m"]
    ) -> Float[Array, "*k c"]:
        """What the sensors show at `times`, s from the run's start."""
        shown, motion = self.truth(times, state, signals)
        for effect in self.effects:
            if self.shows(effect):
                shown |= effect.show(times, shown, motion)
        return stack(shown, self.layout.channels, times)

    def shows(self, effect: AbstractEffect) -> TypeGuard[AbstractInstrument]:
        """Whether an effect is one on outputs, and not on a motion that the file prescribes."""
        return isinstance(effect, AbstractInstrument) and set(effect.channels) <= set(self.layout.channels)

    def truth(
        self, times: Float[Array, " *k"], state: Float[Array, "*k s"], signals: Float[Array, "*k m"]
    ) -> tuple[dict[str, Signal], Motion]:
        """Outputs before any effect of a sensor, by output, and the motion that the sensors see, SI.

        `times` (*k,) are s, `state` (*k, s) and `signals` (*k, m) SI.
        """
        columns = len(self.layout.held) + len(self.layout.interpolated)
        timed = jnp.concatenate([self.true_inputs(signals)[..., :columns], times[..., None]], axis=-1)
        motion = self.motion(state, timed)
        if any(output.channel in SPECIFIC_FORCE for output in self.layout.outputs):
            rates = self.acceleration(state, timed)
            named: dict[str, Signal] = {e: rates[..., i] for i, e in enumerate(self.layout.equations)}
            motion = dataclasses.replace(motion, accelerations=named)
        true = self.channels(motion)

        def seen(true: dict[str, Signal], motion: Motion) -> dict[str, Signal]:
            sensors = self.of_run(motion.positions).sensors
            return {output.name: sensors.show(output, true, motion) for output in self.layout.outputs}

        shown = sample_by_sample(seen, times.shape, true, motion) if self.spreads else seen(true, motion)
        return {name: jnp.broadcast_to(jnp.asarray(one), times.shape) for name, one in shown.items()}, motion

    def deviation(self, measured: Float[Array, "*k c"], modelled: Float[Array, "*k c"]) -> Float[Array, "*k c"]:
        """`measured` minus `modelled` channels; angles of a body wrapped to (-π, π]."""
        return wrapped(self.turning, measured - modelled)

    @property
    def turning(self) -> tuple[bool, ...]:
        """Which channels are angles of a body."""
        return tuple(self.layout.is_angle(output.channel) for output in self.layout.outputs)


def wrapped(turning: tuple[bool, ...], difference: Float[Array, "*k c"]) -> Float[Array, "*k c"]:
    """Differences of channels, of which those that are `turning` are wrapped to (-π, π]."""
    around = jnp.arctan2(jnp.sin(difference), jnp.cos(difference))
    return jnp.where(jnp.array(turning, bool), around, difference)


def memory_states(effects: tuple[AbstractEffect, ...]) -> tuple[str, ...]:
    """The states that `effects` add to a vehicle's."""
    return tuple(name for e in effects if isinstance(e, AbstractMemory) for name in e.states)


def timed(layout: Layout, signals: Float[Array, "*k m"], like: Signal) -> tuple[list[Signal], Signal]:
    """The columns of inputs, prescribed motions and surroundings, and the time, zero where `signals` have none."""
    count = len(layout.held) + len(layout.interpolated)
    time = signals[..., count] if signals.shape[-1] > count else jnp.zeros_like(like)
    return [signals[..., i] for i in range(count)], time


def stack(named: Mapping[str, Signal], order: tuple[str, ...], like: Signal) -> Float[Array, "*k n"]:
    """The named arrays as one, zero where absent, each broadcast to the shape of `like`."""
    if not order:
        return jnp.zeros((*like.shape, 0), like.dtype)
    return jnp.stack([jnp.broadcast_to(named.get(name, 0.0), like.shape) for name in order], -1)
