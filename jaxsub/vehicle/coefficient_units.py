"""What the names of a submerged body's numbers say: what each multiplies, and its unit."""

from collections.abc import Mapping

from ..effects import derivative
from ..effects.motion import unit_per

_BODY = {
    "mass": "kg", "weight": "N", "buoyancy": "N", "speed": "m/s", "I_x": "kg*m^2", "I_y": "kg*m^2", "I_z": "kg*m^2",
    "x_B": "m", "y_B": "m", "z_B": "m", "x_G": "m", "y_G": "m", "z_G": "m",
}  # fmt: skip


def coefficient_unit(name: str, inputs: Mapping[str, str] | None = None) -> str:
    """The SI unit of `name`, such as `N/(m/s)` of `Y_v` and `kg*m` of `Y_rdot`; nothing for what is no such symbol.

    `inputs` has the units of inputs that have no symbol, for `B_yaw_bow_thruster`: `N*m/(V)` of one in volts.
    """
    if (term := derivative(name)) is None:
        return _BODY.get(name, "")
    if term.dimensional:
        return term.unit
    (variable,) = term.inputs
    unit, force = (inputs or {}).get(variable, ""), unit_per(term.equation)
    return f"{force}/({unit})" if unit else ""
