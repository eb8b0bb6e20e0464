"""Systems in which publications give derivatives without dimension, and their conversion to SI."""

import dataclasses
import math

from ..effects import GRAVITY, Derivative
from ..errors import InputError
from ..parameters import Parameter
from .schema import Table, computable, read_positive

# what each system is stated by, with SI units
_SYSTEMS = {
    "prime": {"length": "m", "density": "kg/m³", "speed": "m/s"},
    "mmg": {"length": "m", "draught": "m", "density": "kg/m³", "speed": "m/s"},
    "bis": {"length": "m", "mass": "kg"},
}


@dataclasses.dataclass(frozen=True)
class Scales:
    r"""The units of mass (kg), length (m) and time (s) of a system; a derivative has theirs by its dimension.

    Of `prime` (SNAME 1950) they are $\tfrac12\rho L^3$, L and L/U; of `mmg` (Yasukawa and Yoshimura 2015)
    $\tfrac12\rho L^2d$, L and L/U; of `bis` (Norrbin 1970) m, L and $\sqrt{L/g}$. So of the first
    $Y_v' = Y_v/(\tfrac12\rho L^2U)$ and $Y_{uv}' = Y_{uv}/(\tfrac12\rho L^2)$. `text` says it in words.
    """

    mass: float
    length: float
    time: float
    text: str

    def unit(self, term: Derivative) -> float:
        """The unit of a derivative, SI."""
        mass, length, time = term.dimension
        return self.mass**mass * self.length**length * self.time**time


def scaled(value: float, row: Parameter, unit: float) -> tuple[float, Parameter]:
    """A number in units of `unit`, SI, and its row, in SI."""
    named = {key: unit * getattr(row, key) for key in ("lower", "upper", "prior_std", "prior_mean", "spread")}
    return unit * value, dataclasses.replace(row, **named)


def read_scales(table: Table) -> Scales:
    """The system that `system = { name = "prime", length = …, density = …, speed = … }` states.

    **Raises** `InputError` for another system, and for a size that is missing, not positive or not the system's.
    """
    name = table.choice("name", tuple(_SYSTEMS))
    units = _SYSTEMS[name]
    table.only(("name", *units))
    sizes = {key: read_positive(table.required(key), table.place(key)) for key in units}
    text = f"{name} system ({', '.join(f'{key} {sizes[key]:g} {unit}' for key, unit in units.items())})"
    if name == "bis":
        return Scales(sizes["mass"], sizes["length"], math.sqrt(sizes["length"] / GRAVITY), text)
    mass = 0.5 * sizes["density"] * sizes["length"] ** 2 * sizes.get("draught", sizes["length"])
    return Scales(mass, sizes["length"], sizes["length"] / sizes["speed"], text)


def check_scaled(value: float, place: str) -> None:
    """Refuse a number that its system's unit makes too large or too small to compute with."""
    if not computable(value):
        raise InputError(place, f"is {value:.3g} in SI", "check the sizes of coefficients.system")
