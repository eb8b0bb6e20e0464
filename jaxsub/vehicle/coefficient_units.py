"""What the names of a submerged body's numbers say: what each multiplies, and its unit."""

from ..effects import derivative

_BODY = {
    "mass": "kg", "weight": "N", "buoyancy": "N", "speed": "m/s", "I_x": "kg*m^2", "I_y": "kg*m^2", "I_z": "kg*m^2",
    "x_B": "m", "y_B": "m", "z_B": "m", "x_G": "m", "y_G": "m", "z_G": "m",
}  # fmt: skip


def coefficient_unit(name: str) -> str:
    """The SI unit of `name`, such as `N/(m/s)` of `Y_v` and `kg*m` of `Y_rdot`; nothing for what is no such symbol."""
    term = derivative(name)
    return _BODY.get(name, "") if term is None else term.unit
