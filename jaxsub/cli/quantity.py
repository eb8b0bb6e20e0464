"""Numbers with units as options of a command."""

import re
from collections.abc import Callable
from typing import Any

import click

# said here and not asked of `vehicle`, so that `--help` needs no jax or NumPy; a test holds the two together
DIMENSIONS = {
    "length": ("m", "Of the hull; of a ship between perpendiculars."),
    "diameter": ("m", "Largest, of a round hull."),
    "beam": ("m", "Largest breadth."),
    "height": ("m", "Of an ROV."),
    "draught": ("m", "From the waterline to the keel."),
    "mass": ("kg", "In air, with the water in closed tanks."),
    "speed": ("m/s", "Usual speed."),
    "fin-span": ("m", "Of one fin, or wing of a glider, from root to tip."),
    "fin-chord": ("m", "Mean chord of that."),
    "density": ("kg/m^3", "Of the water; 1025 where not given."),
}


class Quantity(click.ParamType):
    """A positive number with a unit, such as `1.6m` or `160 cm`; without one in the SI unit `unit`."""

    name = "number"

    def __init__(self, unit: str) -> None:
        self.unit = unit

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """`value` in SI.

        Raises
            click.BadParameter: it is no positive number, or of another dimension.
        """
        import numpy as np

        from ..units import UnknownUnit, same_dimension, to_si

        found = re.fullmatch(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", str(value))
        if not found:
            self.fail(f"{value!r:.60} is no number; write it like 1.6 or 1.6{self.unit}", param, ctx)
        unit = found[2].strip() or self.unit
        try:
            if not same_dimension(unit, self.unit):
                self.fail(f"{value!r:.60} is not in {self.unit} or another unit of that dimension", param, ctx)
            size = float(to_si(np.array([float(found[1])]), unit)[0])
        except UnknownUnit as error:
            self.fail(f"{error}; {error.remedy}", param, ctx)
        if not 0.0 < size < 1e12:
            self.fail(f"{value!r:.60} is not above zero, or larger than any vehicle's", param, ctx)
        return size


def dimensions(command: Callable) -> Callable:
    """Give `command` an option for each of `DIMENSIONS`."""
    for name, (unit, text) in reversed(DIMENSIONS.items()):
        command = click.option(f"--{name}", type=Quantity(unit), metavar=f"NUMBER[{unit}]", help=text)(command)
    return command
