"""Main dimensions from which a vehicle file is begun."""

import dataclasses
from collections.abc import Mapping
from typing import Self

from ...effects import STANDARD_DENSITY
from ...errors import InputError

# of each dimension its SI unit
SIZES: dict[str, str] = {
    "length": "m", "diameter": "m", "beam": "m", "height": "m", "draught": "m", "mass": "kg", "speed": "m/s",
    "fin_span": "m", "fin_chord": "m", "density": "kg/m^3",
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Kind:
    """A kind of vehicle: the dimensions that it needs beside length and mass, and those that it may have.

    `speed` is the usual one in m/s, zero where that follows from the length.
    """

    name: str
    needs: tuple[str, ...]
    takes: tuple[str, ...] = ()
    speed: float = 1.0


@dataclasses.dataclass(frozen=True)
class Sizes:
    """Dimensions in SI, each positive; zero where not given.

    **Fields**

    - `length`: of the hull; `diameter`: of a round one, or `beam` and `height`; `draught`: of the keel; m.
    - `mass`: in air, kg. `speed`: usual, m/s. `density`: of the water, kg/m³.
    - `fin_span`: from root to tip of one fin; `fin_chord`: its mean; m.
    """

    length: float
    mass: float
    diameter: float = 0.0
    beam: float = 0.0
    height: float = 0.0
    draught: float = 0.0
    speed: float = 0.0
    fin_span: float = 0.0
    fin_chord: float = 0.0
    density: float = STANDARD_DENSITY

    @classmethod
    def of(cls, kind: Kind, given: Mapping[str, float]) -> Self:
        """The dimensions `given` for a vehicle of that `kind`, its usual speed where none is.

        **Raises** `InputError` for one that is missing, that the kind does not have, or that is not positive.
        """
        needed = ("length", "mass", *kind.needs)
        known = (*needed, *kind.takes, "speed", "density")
        for name, value in given.items():
            if name not in known:
                takes = ", ".join(map(option, known))
                raise InputError(option(name), f"is no dimension of {kind.name}", f"it takes {takes}")
            if not value > 0.0:
                raise InputError(option(name), f"is {value:g}", "give a positive number")
        for name in needed:
            if name not in given:
                raise InputError(option(name), f"is missing for {kind.name}", f"give it in {SIZES[name]}")
        if ("fin_span" in given) != ("fin_chord" in given):
            missing = "fin_chord" if "fin_span" in given else "fin_span"
            raise InputError(option(missing), "is missing", "a planform is a span and a chord")
        return cls(**{"speed": kind.speed, **given})

    @property
    def displaced(self) -> float:
        """Volume of the displaced water where the vehicle floats or is trimmed, m³."""
        return self.mass / self.density

    def require_room(self, volume: float, shape: str) -> None:
        """Raise `InputError` where the `volume` (m³) of the hull's `shape` cannot displace the vehicle's mass.

        A tenth is left for what dimensions are rounded by.
        """
        if self.displaced > 1.1 * volume:
            what = f"is {self.mass:g} kg, and {shape} of these dimensions displaces {self.density * volume:.3g} kg"
            raise InputError("--mass", what, "check dimensions and units")


def option(name: str) -> str:
    """A dimension as the command line has it."""
    return f"--{name.replace('_', '-')}"
