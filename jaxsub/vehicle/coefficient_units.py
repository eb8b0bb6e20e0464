"""What the names of a submerged body's numbers say: what each multiplies, and its unit."""

import re

from ..effects import EQUATIONS, unit_per
from .inertia import place

ADDED = re.compile(r"^[XYZKMN]_[uvwpqr]dot$")
DAMPING = re.compile(r"^[XYZKMN]_[uvwpqr]$")
CONTROL = re.compile(r"^[XYZKMN]_(0|nn|delta_(r|er|el|e|s))$")

_BODY = {
    "mass": "kg", "weight": "N", "buoyancy": "N", "speed": "m/s", "I_x": "kg*m^2", "I_y": "kg*m^2", "I_z": "kg*m^2",
    "x_B": "m", "y_B": "m", "z_B": "m",
}  # fmt: skip
_INERTIA = ("kg", "kg*m", "kg*m^2")
_TURNING = EQUATIONS[3:]


def coefficient_unit(name: str) -> str:
    """The SI unit of `name`, such as `N/(m/s)` of `Y_v` and `kg*m` of `Y_rdot`; nothing for what is no such symbol."""
    if ADDED.match(name):
        return _INERTIA[sum(EQUATIONS[index] in _TURNING for index in place(name))]
    if DAMPING.match(name):
        return unit_per(*(EQUATIONS[index] for index in place(name)))
    if match := CONTROL.match(name):
        # a shaft turns as a body does, in rad/s
        variables = {"0": (), "nn": (_TURNING[0], _TURNING[0])}.get(match[1], ("fin",))
        return unit_per(EQUATIONS["XYZKMN".index(name[0])], *variables)
    return _BODY.get(name, "")
