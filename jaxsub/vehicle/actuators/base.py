"""What an actuator of a body is: a command in, forces along fixed lines out."""

import abc
import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...arrays import Values
from ...effects import EQUATIONS, STANDARD_DENSITY, Derivative, Motion, Signal
from ...parameters import number
from .keys import Key

# a size (N or N m), which is an array or a number of NumPy's, and the generalised force (6,) of one such in body axes
Load = tuple[Any, np.ndarray]


class Actuator(eqx.Module):
    r"""A device of `[actuators]` that turns a command into generalised forces $\tau = \sum_k a_k w_k$.

    Concrete ones declare `keys`, the keys of their table in a vehicle file; reading and writing follow from these. What
    a key says is a number in `numbers`, which a fit may move, or else the static field of that name.

    **Fields**

    - `name`: under `[actuators]`.
    - `input`: (name, weight) pairs of `[inputs]`, whose weighted sum is the command.
    - `numbers`: SI, by key; of a key with several, by key and label such as `dead_band_low`.
    - `limits`: least and largest command.
    - `density`: of the water where none is recorded, kg/m³.
    """

    kind: ClassVar[str]
    keys: ClassVar[Mapping[str, Key]]
    command_unit: ClassVar[str] = ""

    name: str = eqx.field(static=True)
    input: tuple[tuple[str, float], ...] = eqx.field(static=True)
    numbers: dict[str, Float[Array, ""]]
    limits: tuple[float, float] = eqx.field(static=True, default=(-math.inf, math.inf))
    density: float = eqx.field(static=True, default=STANDARD_DENSITY)

    @abc.abstractmethod
    def loads(self, motion: Motion, beside: Mapping[str, "Actuator"]) -> list[Load]:
        """Sizes and unit forces; `beside` has all actuators of the vehicle by name."""

    @property
    def input_unit(self) -> str:
        """SI unit that its command has to have; empty where it may be any."""
        return self.command_unit

    def acts_on(self) -> tuple[str, ...]:
        """The equations that a command reaches."""
        return ()

    def check(self, beside: Mapping[str, "Actuator"]) -> tuple[str, str, str] | None:
        """What is wrong with its keys together, if anything: the key, what, and what to do."""
        return None

    def unit_of(self, key: str, stated: str) -> str:
        """SI unit of the numbers of `key`, where the input has the unit `stated` (empty if unknown)."""
        return self.keys[key].unit

    @property
    def factor(self) -> str:
        """The key of a number to which its whole force is in proportion, 1 where the file gives none; or nothing."""
        return "gain" if "gain" in self.keys else ""

    @property
    def lifts(self) -> bool:
        """Whether its force is lift, which grows with the square of the speed."""
        return False

    @property
    def follows(self) -> bool:
        """Whether its force follows the velocity of the body."""
        return False

    def command(self, motion: Motion) -> Signal:
        """The weighted sum of its inputs within the limits."""
        parts = [motion.actuators[name] if w == 1.0 else w * motion.actuators[name] for name, w in self.input]
        total = sum(parts[1:], parts[0])
        return total if self.limits == (-math.inf, math.inf) else jnp.clip(total, *self.limits)

    def value(self, key: str, default: Values | float = 0.0) -> Any:
        """The number of `key`, `default` where the file gives none."""
        return self.numbers.get(key, default)

    def water(self, motion: Motion) -> Signal | float:
        """Density of the water, kg/m³."""
        return motion.environment.get("density", self.density)


class Actuators(eqx.Module):
    """All actuators of a body."""

    items: tuple[Actuator, ...] = ()

    def force(self, motion: Motion, name: str = "") -> dict[str, Signal]:
        """Generalised force by equation (N, N m), of the motion's shape; of all, or of the actuator `name` alone."""
        beside = {item.name: item for item in self.items}
        own = [beside[name]] if name else self.items
        loads = [load for item in own for load in item.loads(motion, beside)]
        if not loads:
            return {}
        lines = np.stack([line for _, line in loads])
        sizes = jnp.stack(jnp.broadcast_arrays(*(size for size, _ in loads)), -1)
        # one product for all: each operation is traced in every use of the model
        total = sizes @ lines.astype(sizes.dtype)
        return {e: total[..., i] for i, e in enumerate(EQUATIONS) if np.any(lines[:, i])}

    def values(self) -> dict[str, Array]:
        """Every number by its name in the vehicle, such as `bow.gain`."""
        return {f"{item.name}.{key}": value for item in self.items for key, value in item.numbers.items()}

    def with_values(self, values: Mapping[str, Values]) -> Self:
        """The same actuators with other numbers for those named."""

        def update(item: Actuator) -> Actuator:
            moved = {key: number(values.get(f"{item.name}.{key}", old)) for key, old in item.numbers.items()}
            return dataclasses.replace(item, numbers=moved)

        return dataclasses.replace(self, items=tuple(map(update, self.items)))

    def in_water(self, density: float) -> Self:
        """The same actuators in water of that density (kg/m³) where none is recorded."""
        items = tuple(dataclasses.replace(item, density=density) for item in self.items)
        return dataclasses.replace(self, items=items)

    @property
    def names(self) -> frozenset[str]:
        """What they say of the body's equations (`Facts.has`): the names of the derivatives by their inputs."""
        acting = [(item.lifts, e, name) for item in self.items for e in item.acts_on() for name, _ in item.input]
        said = [Derivative.by(e, name) for _, e, name in acting]
        said += [Derivative.by(e, "surge", "surge", name) for lifts, e, name in acting if lifts]
        return frozenset(one.name for one in said)


def line(position: Sequence[float], direction: Sequence[float] | np.ndarray) -> np.ndarray:
    """Generalised force (6,) of 1 N along `direction` at `position` (m)."""
    return np.concatenate([direction, np.cross(position, direction)])


def velocity_along(motion: Motion, along: np.ndarray) -> Signal:
    """Velocity through the water of a point of the body along a line (6,), m/s."""
    flow = motion.flow
    parts = [flow[e] if w == 1.0 else float(w) * flow[e] for e, w in zip(EQUATIONS, along, strict=True) if w]
    return sum(parts[1:], parts[0])


def equations_of(*lines: np.ndarray) -> tuple[str, ...]:
    """The equations that forces along `lines` (6,) act on, those of rounding apart."""
    size = np.abs(np.array(lines)).sum(0)
    return tuple(e for e, w in zip(EQUATIONS, size, strict=True) if w > 1e-9)
