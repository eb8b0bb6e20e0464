"""The force of each actuator of a vehicle by itself, and those whose force no free number scales as a whole."""

import dataclasses

from jaxtyping import Array, Float

from ..effects import AbstractActuation, Motion, Signal
from .actuators import Actuators
from .base import Layout
from .products import Products


class BodyActuation(AbstractActuation):
    """Of a body: the force of a device of `[actuators]`, or of all coefficients by an input."""

    products: Products
    actuators: Actuators

    def force_of(self, name: str, motion: Motion) -> dict[str, Signal]:
        """Of an input, what the products are with the command less what they are without it."""
        if name in self._devices:
            return self.actuators.force(motion, name)
        by = self.products.by(name, motion.actuators)
        if not by:
            raise KeyError(name)
        idle = dataclasses.replace(motion, actuators=motion.actuators | {name: 0.0 * motion.actuators[name]})
        all_on, without = self.products.force(motion), self.products.force(idle)
        return {e: all_on[e] - without[e] for e in {term.equation: None for term in by.values()}}

    def fixed_gains(self, layout: Layout) -> tuple[str, ...]:
        """The actuators with a force on a free equation, all of which is in proportion to no free number."""
        free, inputs = {row.name for row in layout.free}, [name for name, _ in layout.inputs]
        devices = [item for item in self.actuators.items if set(item.acts_on()) & set(layout.equations)]
        found = [item.name for item in devices if f"{item.name}.{item.factor}" not in free]
        for name in inputs:
            by = self.products.by(name, inputs)
            felt = {symbol: term for symbol, term in by.items() if term.equation in layout.equations}
            # the mean of two elevators is in proportion to neither
            scaled = all(symbol in free and name in term.inputs for symbol, term in felt.items())
            if name not in self._devices and not scaled:
                found.append(name)
        return tuple(found)

    @property
    def _devices(self) -> set[str]:
        """Those with a force of their own."""
        return {item.name for item in self.actuators.items if item.acts_on()}


class RigActuation(AbstractActuation):
    r"""Of a mechanism: $B_{ia}u_a$.

    **Fields**

    - `drives`: B by actuator and coordinate.
    """

    drives: dict[str, dict[str, Float[Array, ""]]]

    def force_of(self, name: str, motion: Motion) -> dict[str, Signal]:
        """By coordinate."""
        return {e: gain * motion.actuators[name] for e, gain in self.drives[name].items()}
