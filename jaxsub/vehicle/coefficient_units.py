"""The units of a submerged body's own numbers, which their SNAME symbols say."""

import re

from ..effects import EQUATIONS, VELOCITIES, unit_per

_BODY = {
    "mass": "kg", "weight": "N", "buoyancy": "N", "speed": "m/s", "I_x": "kg*m^2", "I_y": "kg*m^2", "I_z": "kg*m^2",
    "x_B": "m", "y_B": "m", "z_B": "m",
}  # fmt: skip
_INERTIA = ("kg", "kg*m", "kg*m^2")
_DERIVATIVE = re.compile(r"([XYZKMN])_(?:(?P<added>[uvwpqr])dot|(?P<velocity>[uvwpqr])|(?P<fin>delta_\w+)|(nn)|(0))")


def coefficient_unit(name: str) -> str:
    """The SI unit of `name`, such as `N/(m/s)` of `Y_v` and `kg*m` of `Y_rdot`; nothing for what is no such symbol."""
    match = _DERIVATIVE.fullmatch(name)
    if match is None:
        return _BODY.get(name, "")
    equation = EQUATIONS["XYZKMN".index(match[1])]
    by = {velocity: equation for equation, velocity in VELOCITIES.items()}
    if match["added"]:
        return _INERTIA[sum(one in EQUATIONS[3:] for one in (equation, by[match["added"]]))]
    if match["velocity"]:
        return unit_per(equation, by[match["velocity"]])
    turning = EQUATIONS[3]  # a shaft turns as a body does, in rad/s
    return unit_per(equation, *{"0": (), "nn": (turning, turning)}.get(name[2:], ("fin",)))
