r"""The sampled plant: a vehicle as $x_{k+1} = f(x_k, u_k)$, $y_k = h(x_k, u_k)$ with all that it remembers in x."""

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..effects import AbstractActuator, AbstractEffect, AbstractSensor
from ..errors import InputError, require_known
from ..filter.model import linearised
from ..methods import jittable
from ..programs import compiled
from ..simulation import Sampled, step_table
from ..simulation.exponential import StepTable
from ..vehicle import AbstractVehicle
from ..vehicle.base import stack

Time = Float[Array, ""] | float


class PlantJacobians(NamedTuple):
    """A (s, s) and B (s, m) of the step, C (c, s) and D (c, m) of the outputs."""

    A: Float[Array, "s s"]
    B: Float[Array, "s m"]
    C: Float[Array, "c s"]
    D: Float[Array, "c m"]


class Plant(eqx.Module):
    """A vehicle, its inputs held over samples of one length, as a pure function of state and input.

    The step is `Sampled.step`, that of simulation and estimation. The state is [the vehicle's, what each actuator
    remembers, what each sensor does], so that a vehicle with lags, delays, play or late sensors is a plant like any
    other. Everything may be differentiated and is safe under jit and vmap; `equinox.filter_jit(plant.step)` compiles
    it. For derivatives by the vehicle's numbers use `with_values`. Physics that follows the time is given it in s; for
    others it may be left out.

    **Fields**

    - `sampled`: the vehicle made ready to step. `dt`: s between samples.
    - `constants`: (columns,) the signals that do not come from u, SI. `driven`: the columns that do.
    - `sizes`: how many numbers each effect remembers.
    """

    sampled: Sampled
    dt: float = eqx.field(static=True)
    constants: Float[Array, " columns"]
    driven: tuple[int, ...] = eqx.field(static=True)
    sizes: tuple[int, ...] = eqx.field(static=True)

    @property
    def vehicle(self) -> AbstractVehicle:
        """The model that it steps."""
        return self.sampled.vehicle

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: velocities, positions, then memories."""
        return (*self.vehicle.layout.states, *_memory_names(self.vehicle.effects, self.sizes))

    @property
    def inputs(self) -> tuple[str, ...]:
        """The actuators that u sets."""
        return tuple(self.vehicle.layout.inputs[column][0] for column in self.driven)

    @property
    def outputs(self) -> tuple[str, ...]:
        """The measured channels."""
        return self.vehicle.layout.channels

    @property
    def own(self) -> int:
        """How many of the states are the vehicle's."""
        return len(self.vehicle.layout.equations) + len(self.vehicle.layout.positions)

    def with_values(self, values: Mapping[str, Any]) -> "Plant":
        """The plant of the same vehicle with other `values` (SI) by name; delays keep their room in the state."""
        sampled = _ready(self.vehicle.with_values(dict(values)), self.dt, self.sampled.substeps)
        return dataclasses.replace(self, sampled=sampled)

    @jittable
    def start(self, state: Float[Array, " n"], inputs: Float[Array, " m"], time: Time = 0.0) -> Float[Array, " s"]:
        """The plant's state where the vehicle's is `state`, and inputs and outputs have long been what they are."""
        signals = self._signals(inputs)
        kept = self._actuate(None, self._nodes(signals, time))[1] | self._shown(None, state, signals, time)[1]
        return jnp.concatenate([state, *[kept[i] for i in sorted(kept)]]).astype(state.dtype)

    @jittable
    def step(self, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> Float[Array, " s"]:
        """The state one sample later; `time` is that of the sample, s."""
        state, memory = self._split(x)
        signals = self._signals(u)
        nodes, commands = self._actuate(memory, self._nodes(signals, time))
        kept = commands | self._shown(memory, state, signals, time)[1]
        after = self.sampled.step(state, nodes, jnp.asarray(0))
        return jnp.concatenate([after, *[kept[i] for i in sorted(kept)]])

    @jittable
    def output(self, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> Float[Array, " c"]:
        """What the sensors show, without noise, in SI."""
        state, memory = self._split(x)
        shown, _ = self._shown(memory, state, self._signals(u), time)
        return stack(shown, self.outputs, state[0])

    def channels(self, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> dict[str, Any]:
        """Every channel that the vehicle can produce, but for accelerometers, before any sensor, SI.

        `x` (s,) is the state, `u` (m,) the inputs, SI, and `time` that of the sample, s.
        """
        signals = self._nodes(self._signals(u), time)[0]
        return self.vehicle.channels(self.vehicle.motion(x[: self.own], signals))

    @jittable
    def jacobians(self, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> PlantJacobians:
        """Derivatives of `step` and `output` by state and input."""
        _, A, B = linearised(lambda x, u: self.step(x, u, time), x, u)
        _, C, D = linearised(lambda x, u: self.output(x, u, time), x, u)
        return PlantJacobians(A, B, C, D)

    def acting(self, u: Float[Array, " m"], time: Time = 0.0) -> Float[Array, " columns1"]:
        """All signals and the time as they act on the vehicle where the inputs have long been `u`."""
        return self._actuate(None, self._nodes(self._signals(u), time))[0][0]

    @jittable
    def run(self, x: Float[Array, " s"], inputs: Float[Array, "k m"], time: Time = 0.0) -> Float[Array, "k1 s"]:
        """The states from `x` on under `inputs`, one more than there are of these."""

        def on(carry: tuple[Array, Array], u: Array) -> tuple[tuple[Array, Array], Array]:
            state, now = carry
            after = self.step(state, u, now)
            return (after, now + self.dt), after

        _, states = jax.lax.scan(on, (x, jnp.asarray(time, x.dtype)), inputs)
        return jnp.concatenate([x[None], states])

    def _split(self, x: Array) -> tuple[Array, list[Array]]:
        """The vehicle's state, and what each effect remembers."""
        ends = itertools.accumulate(self.sizes, initial=self.own)
        return x[: self.own], [x[a:b] for a, b in itertools.pairwise(ends)]

    def _signals(self, u: Array) -> Float[Array, " columns"]:
        constants = self.constants.astype(jnp.result_type(u, self.constants))
        return constants.at[jnp.array(self.driven, int)].set(u)

    def _nodes(self, signals: Array, time: Time) -> Float[Array, "3 columns1"]:
        """The signals, and after them the time, at the start, middle and end of the interval."""
        times = time + self.dt * jnp.array([0.0, 0.5, 1.0], signals.dtype)
        return jnp.concatenate([jnp.broadcast_to(signals, (3, len(signals))), times[:, None]], axis=1)

    def _actuate(self, memory: Sequence[Array] | None, nodes: Array) -> tuple[Array, dict[int, Array]]:
        """`nodes` after the actuators, and what these then remember; without a memory it is all of the command."""
        names = [name for name, _ in self.vehicle.layout.inputs]
        nodes, after = self.vehicle.true_inputs(nodes), {}
        for i, effect in enumerate(self.vehicle.effects):
            if isinstance(effect, AbstractActuator):
                column = names.index(effect.actuator)
                held = jnp.full(self.sizes[i], nodes[0, column]) if memory is None else memory[i]
                kept, done = effect.advance(held, nodes[:, column], jnp.asarray(self.dt, nodes.dtype))
                after[i], nodes = (held if memory is None else kept), nodes.at[:, column].set(done)
        return nodes, after

    def _shown(
        self, memory: Sequence[Array] | None, state: Array, signals: Array, time: Time
    ) -> tuple[dict[str, Any], dict[int, Array]]:
        """The channels as shown, and what the sensors then remember; without a memory it is all of what is true."""
        now = jnp.asarray(time, state.dtype)
        shown, motion = self.vehicle.truth(now, state, signals)
        after: dict[int, Array] = {}
        for i, effect in enumerate(self.vehicle.effects):
            if not self.vehicle.shows(effect):
                continue
            if not isinstance(effect, AbstractSensor) or not effect.remembers:
                shown |= effect.show(now, shown, motion)
                continue
            size, true = self.sizes[i], jnp.asarray(shown[effect.channel])
            past = jnp.full(size, true) if memory is None else memory[i]
            samples = jnp.concatenate([past, true[None]])
            # from now: what is late counts from there, and translators need not search among times they do not know
            times = self.dt * jnp.arange(-size, 1, dtype=state.dtype)
            shown[effect.channel] = effect.measure(times, {effect.channel: samples}, motion)[-1]
            after[i] = past if memory is None else samples[1:]
        return shown, after


def discretise(
    vehicle: AbstractVehicle, dt: float, given: Mapping[str, float] | None = None, *, substeps: int = 1
) -> Plant:
    """The plant of `vehicle` for samples `dt` s apart, each of `substeps` steps.

    `given` are constants by column name, SI: prescribed motions and surroundings, all of which it needs, and inputs
    that nobody is to move. The other inputs are the plant's, in the file's order. A number that differs by run has its
    mean.

    **Raises** `InputError` for a `dt` that is not positive, a column that is missing or unknown, and an effect that
    does not say how it goes on from sample to sample.
    """
    vehicle = vehicle.at_mean
    layout, given = vehicle.layout, {} if given is None else given
    if not dt > 0.0:
        raise InputError(f"{layout.name}: dt", f"{dt:g} s is not positive", "give the time between samples in s")
    columns = (*layout.held, *layout.interpolated)
    require_known("given column", given, columns, layout.name)
    for name in layout.interpolated:
        if name not in given:
            raise InputError(f"{layout.name}: column {name!r}", "is no input of a plant", f"give {name!r} a constant")
    driven = tuple(column for column, name in enumerate(layout.held) if name not in given)
    sampled = _ready(vehicle, dt, substeps)
    constants = jnp.asarray([given.get(name, 0.0) for name in columns], sampled.inverse.dtype)
    plant = Plant(sampled, float(dt), constants, driven, tuple(_remembered(e, dt) for e in vehicle.effects))
    state, inputs = (jnp.zeros(size, sampled.inverse.dtype) for size in (plant.own, len(driven)))
    # an effect that cannot be stepped says so here and not in the midst of a program
    jax.eval_shape(lambda: plant.step(plant.start(state, inputs), inputs))
    return plant


def _ready(vehicle: AbstractVehicle, dt: float, substeps: int) -> Sampled:
    return Sampled(vehicle, *_weights(vehicle, dt / substeps), substeps)


@compiled
def _weights(vehicle: AbstractVehicle, length: float) -> tuple[Array, StepTable]:
    """The inverse inertia, and the weights of one step length in s."""
    inverse = jnp.linalg.inv(vehicle.mass_matrix())
    return inverse, step_table(inverse @ vehicle.damping_matrix(), jnp.full(1, length, inverse.dtype))


def _remembered(effect: AbstractEffect, dt: float) -> int:
    return effect.remembered(dt) if isinstance(effect, AbstractActuator | AbstractSensor) else 0


def _memory_names(effects: Sequence[AbstractEffect], sizes: Sequence[int]) -> list[str]:
    """A name for each number that an actuator or a sensor remembers, counted through for each."""
    names: list[str] = []
    for effect, size in zip(effects, sizes, strict=True):
        if isinstance(effect, AbstractActuator | AbstractSensor):
            of = effect.actuator if isinstance(effect, AbstractActuator) else effect.channel
            count = sum(name.startswith(f"{of}_held_") for name in names)
            names += [f"{of}_held_{count + i}" for i in range(size)]
    return names
