"""What an effect is: a small module that adds a force, changes an actuator or changes a sensor."""

import abc
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ..errors import InputError
from ..parameters import Parameter, number
from .derivatives import Derivative
from .motion import EQUATIONS, Facts, Motion, Signal


def amplitude(unit: str, sign: int = 0, default: float = 0.0, most: float = math.inf) -> Any:
    """A field in `unit` that the effect is linear in about zero, of a size that physics admits up to `most`.

    `sign` +1 or -1 is the only one that it admits; 0 admits both. `default` is its value where none is given.
    """
    return _field("amplitude", unit, sign, default, most)


def shape(unit: str, sign: int = 0, default: float = 0.0) -> Any:
    """A field in `unit` that the effect is not linear in, such as a time constant; candidates lie on a grid of it.

    `sign` and `default` are as of `amplitude`.
    """
    return _field("shape", unit, sign, default)


def edge() -> Any:
    """A static number of either sign, where something begins or ends; other static numbers are sizes, and positive."""
    return eqx.field(static=True, metadata={"signed": True})


def of_output() -> Any:
    """A static text that a vehicle fills in: what the effect's channels show, as `Facts.quantities` has it."""
    return eqx.field(static=True, default="", metadata={"of_output": True})


def _field(role: str, unit: str, sign: int, default: float, most: float = math.inf) -> Any:
    return eqx.field(
        default_factory=lambda: number(default),
        converter=number,
        metadata={"role": role, "unit": unit, "sign": sign, "most": most},
    )


class AbstractEffect(eqx.Module):
    """A piece of physics by its name in the vocabulary.

    Concrete effects declare their options (strings, hull sizes) as static fields and their numbers with
    `amplitude` or `shape`; names, units, admissible signs, reading and writing all follow from those.
    """

    name: ClassVar[str]
    family: ClassVar[str]

    @classmethod
    @abc.abstractmethod
    def candidates(cls, facts: Facts) -> "Sequence[Self]":
        """Forms of this effect that make sense on the vehicle of `facts`, amplitudes zero and shapes on a grid."""

    @classmethod
    def looked_at(cls, facts: Facts) -> int:
        """How many forms there were for the vehicle of `facts`, where `candidates` are the most promising of more.

        Zero where they are all.
        """
        return 0

    @property
    @abc.abstractmethod
    def where(self) -> tuple[str, ...]:
        """Equations it acts on, or `input:NAME`, or `sensor:CHANNEL`."""

    @property
    @abc.abstractmethod
    def expression(self) -> str:
        """The added term, as a person would write it."""

    def symbols(self) -> dict[str, str]:
        """The symbol under which each numeric field is known to the user; the field's own name by default."""
        return {field.name: field.name for field in number_fields(self)}

    @property
    def term(self) -> str:
        """The name of what a vehicle may contain that makes this effect superfluous (`Facts.has`)."""
        return ""

    @property
    def replaces(self) -> tuple[str, ...]:
        """Coefficients of a vehicle that are another law of the same force, and may be zero beside this one."""
        return ()

    @property
    def label(self) -> str:
        """A name that distinguishes two forms of one effect, such as `quadratic-damping[roll]`."""
        chosen = ",".join(value for value in options(self).values() if isinstance(value, str))
        return f"{self.name}[{chosen}]" if chosen else self.name

    def units(self) -> dict[str, str]:
        """The unit of each numeric field."""
        return {field.name: field.metadata["unit"] for field in number_fields(self)}

    def prior_std(self) -> dict[str, float]:
        """Prior standard deviations of numeric fields about zero, SI, where they are known."""
        return {}

    def signs(self) -> dict[str, int]:
        """The only sign that physics admits of each numeric field, +1 or -1; 0 admits both."""
        return {field.name: field.metadata["sign"] for field in number_fields(self)}


class AbstractForce(AbstractEffect):
    """An effect that adds generalised forces to the equations of motion."""

    @abc.abstractmethod
    def force(self, motion: Motion) -> dict[str, Signal]:
        """Generalised force (N or N m) by equation; leading axes follow those of `motion`."""


class AbstractFlow(AbstractEffect):
    """An effect that moves the water about a body, whose forces of the water all follow its velocity through it.

    It is linear in its amplitudes to first order only.
    """

    @abc.abstractmethod
    def water(self, positions: Mapping[str, Signal]) -> tuple[Signal, Signal, Signal]:
        """Velocity of the water in body axes (m/s) at the attitude and place `positions`."""


class AbstractDerivative(AbstractForce):
    r"""An effect that is one `Derivative` with one number: $\tau_i = c\,\prod_j x_j^{k_j}$."""

    @property
    @abc.abstractmethod
    def derivative(self) -> Derivative:
        """Equation and product."""

    @property
    def where(self) -> tuple[str, ...]:
        """The one equation."""
        return (self.derivative.equation,)

    @property
    def expression(self) -> str:
        """The number and the product."""
        (symbol,) = self.symbols().values()
        return f"{symbol} {self.derivative.expression}".rstrip()

    @property
    def term(self) -> str:
        """The derivative's symbol, of a body's equation."""
        return self.derivative.name if self.derivative.equation in EQUATIONS else ""

    def units(self) -> dict[str, str]:
        """Force per product."""
        (field,) = amplitudes(self)
        return {field: self.derivative.unit}

    def force(self, motion: Motion) -> dict[str, Signal]:
        """The force along the motion."""
        (field,) = amplitudes(self)
        e = self.derivative.equation
        # a constant has the shape of the motion too
        zero = 0.0 if self.derivative.powers else 0.0 * motion.rates[e]
        return {e: getattr(self, field) * self.derivative.product(motion) + zero}


class AbstractActuator(AbstractEffect):
    """An effect that stands between a command and what the actuator does."""

    actuator: eqx.AbstractVar[str]

    @abc.abstractmethod
    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """The actuator's deflections at the start, middle and end of each sample interval, given the commands there.

        `times` (K,) are the samples, s; `nodes` (K-1, 3) the commands, SI.
        """

    def remembered(self, interval: float) -> int:
        """How many numbers it carries from one sample to the next, `interval` s apart; each starts at the command."""
        return 0

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The deflections of `respond` over one interval given its `memory`, and the memory after it.

        `nodes` (3,) are the commands at the start, middle and end of the `interval` of so many s. **Raises**
        `InputError` where an effect does not say.
        """
        remedy = "let its class derive from AbstractCurve if it has no memory, else define remembered and advance"
        raise InputError(self.label, "does not say how it goes on from one sample to the next", remedy)

    @property
    def where(self) -> tuple[str, ...]:
        """The actuator."""
        return (f"input:{self.actuator}",)


class AbstractCurve(AbstractActuator):
    """An actuator whose deflection is a function of the command at the same time."""

    @abc.abstractmethod
    def bend(self, command: Float[Array, " *k"]) -> Float[Array, " *k"]:
        """The deflection for a `command`, both SI."""

    def respond(self, times: Float[Array, " k"], nodes: Float[Array, "k1 3"]) -> Float[Array, "k1 3"]:
        """The deflections."""
        return self.bend(nodes)

    def advance(
        self, memory: Float[Array, " m"], nodes: Float[Array, "3"], interval: Float[Array, ""]
    ) -> tuple[Float[Array, " m"], Float[Array, "3"]]:
        """The deflections; there is nothing to remember."""
        return memory, self.bend(nodes)


class AbstractInstrument(AbstractEffect):
    """An effect that stands between true outputs and what an instrument of one or more channels records of them.

    `reach` is how many times the vehicle's length its amplitude may be, where it is a distance.
    """

    reach: ClassVar[float | None] = None

    @property
    @abc.abstractmethod
    def channels(self) -> tuple[str, ...]:
        """What it changes."""

    @abc.abstractmethod
    def show(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> dict[str, Float[Signal, " *k"]]:
        """What each of its `channels` shows at `times` (s from the run's start), given the `outputs` without it.

        Leading axes of `outputs` and `motion` follow those of `times`, the last of which is time.
        """

    @property
    def where(self) -> tuple[str, ...]:
        """The sensors."""
        return tuple(f"sensor:{channel}" for channel in self.channels)


class AbstractSensor(AbstractInstrument):
    """An effect on one channel."""

    channel: eqx.AbstractVar[str]

    # whether it shows something of earlier samples, which a filter or an autopilot does not keep
    remembers: ClassVar[bool] = False
    # whether `undone` says what was true at each sample by itself, as it must of a motion that the file prescribes
    of_prescribed: ClassVar[bool] = False

    @abc.abstractmethod
    def measure(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> Float[Signal, " *k"]:
        """The channel as recorded at `times` (s), given true `outputs` by channel and the `motion`, SI."""

    @property
    def channels(self) -> tuple[str, ...]:
        """The one."""
        return (self.channel,)

    @property
    def delay(self) -> Signal | float:
        """How late its readings are, s."""
        return 0.0

    def show(
        self, times: Float[Signal, " *k"], outputs: Mapping[str, Signal], motion: Motion
    ) -> dict[str, Float[Signal, " *k"]]:
        """The channel."""
        return {self.channel: self.measure(times, outputs, motion)}

    def remembered(self, interval: float) -> int:
        """How many earlier true samples of its channel, `interval` s apart, `measure` has to see.

        A plant shows it these and the present one, at times counted from the present.

        **Raises** `InputError` where one that `remembers` does not say.
        """
        if self.remembers:
            raise InputError(self.label, "does not say how many samples it remembers", "define remembered")
        return 0

    def undone(self, times: Float[Signal, " *k"], recorded: Float[Signal, " *k"]) -> Float[Signal, " *k"]:
        """What was true at `times` (s from the run's start) by what was `recorded`, of one run.

        Of what `remembers` only, brought to the times at which it was true, and of what is `of_prescribed`.
        """
        return recorded


def number_fields(effect: AbstractEffect | type[AbstractEffect]) -> list[dataclasses.Field]:
    """The numeric fields of an effect, in order."""
    return [field for field in dataclasses.fields(effect) if "role" in field.metadata]


def amplitudes(effect: AbstractEffect | type[AbstractEffect]) -> list[str]:
    """Names of the fields that the effect is linear in."""
    return [field.name for field in number_fields(effect) if field.metadata["role"] == "amplitude"]


def numbers(effect: AbstractEffect) -> dict[str, float]:
    """The values (SI) of the numeric fields of `effect`, by field."""
    return {field.name: float(getattr(effect, field.name)) for field in number_fields(effect)}


def options(effect: AbstractEffect) -> dict[str, Any]:
    """The static choices of an effect: its equation, actuator or channel, and fixed sizes."""
    return {field.name: getattr(effect, field.name) for field in option_fields(type(effect))}


def option_fields(kind: type[AbstractEffect]) -> list[dataclasses.Field]:
    """The fields of an effect that are static choices."""
    return [field for field in dataclasses.fields(kind) if not {"role", "of_output"} & set(field.metadata)]


def parameter_table(effect: AbstractEffect) -> dict[str, Parameter]:
    """A free `Parameter` for each numeric field. Signs are judged after the fit, not forced in it: a fit that wants
    a negative drag is evidence against the effect, and a bound would hide it."""
    symbols, units, signs, spread = effect.symbols(), effect.units(), effect.signs(), effect.prior_std()
    rows = {}
    for field in number_fields(effect):
        # a shape such as a time constant has no meaning below zero, so there the bound is the physics
        lower = 0.0 if field.metadata["role"] == "shape" and signs[field.name] > 0 else -math.inf
        name = f"{effect.label}.{symbols[field.name]}"
        rows[field.name] = Parameter(name, units[field.name], lower=lower, prior_std=spread.get(field.name, math.inf))
    return rows


def stacked(effects: Sequence[AbstractEffect]) -> list[tuple[list[int], Any]]:
    """`effects` that differ in their numbers alone as one whose numbers have a leading axis; and which those are.

    What is compiled for such a stack serves all of it.
    """
    alike: dict[Any, list[int]] = {}
    for index, effect in enumerate(effects):
        alike.setdefault(jax.tree.structure(effect), []).append(index)
    stack = lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves])
    return [(own, jax.tree.map(stack, *(effects[i] for i in own))) for own in alike.values()]


def admissible(effect: AbstractEffect, values: dict[str, float]) -> bool:
    """Whether each of the `values` (SI) of `effect` has a sign that physics permits and is no larger than it admits."""
    return all(low <= values[name] <= high for name, (low, high) in admitted(effect).items())


def admitted(effect: AbstractEffect) -> dict[str, tuple[float, float]]:
    """Between which values (SI) physics admits each numeric field of `effect`, by its sign and its largest size."""
    signs, found = effect.signs(), {}
    for field in number_fields(effect):
        most, sign = field.metadata["most"], signs.get(field.name, 0)
        found[field.name] = (0.0 if sign > 0 else -most), (0.0 if sign < 0 else most)
    return found


def with_numbers(effect: AbstractEffect, values: Mapping[str, ArrayLike]) -> Any:
    """The same `effect` with other `values` (SI) of its numeric fields, by field."""
    names = [field.name for field in number_fields(effect)]
    return eqx.tree_at(
        lambda e: [getattr(e, n) for n in names], effect, [number(values.get(n, getattr(effect, n))) for n in names]
    )
