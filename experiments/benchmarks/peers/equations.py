"""NPS AUV II written out once more for any arithmetic, independently of the library: NumPy's and CasADi's.

A state is u, v, w, p, q, r, φ, θ, ψ, z in SI, and all of it is measured. Every entry is a number, an array over a
batch, or a symbol; matrices are nested lists in which an exact 0.0 says that an entry is absent.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

EQUATIONS = "XYZKMN"
_VELOCITIES = "uvwpqr"
_RIGID = ("mass", "mass", "mass", "I_x", "I_y", "I_z")

Matrix = list[list[Any]]
# a sequence, or an array whose first axis is one
Entries = Any
Trigonometry = tuple[Callable, Callable]


def mass_matrix(values: Mapping[str, Any]) -> Matrix:
    """Rigid body and added mass."""
    matrix = [[values[_RIGID[i]] if i == j else 0.0 for j in range(6)] for i in range(6)]
    for name, value in values.items():
        if name.endswith("dot"):
            row, column = EQUATIONS.index(name[0]), _VELOCITIES.index(name[2])
            matrix[row][column] = matrix[row][column] - value
    return matrix


def damping_matrix(values: Mapping[str, Any]) -> Matrix:
    """Linear damping, and the terms of going around at the operating speed."""
    matrix: Matrix = [[values.get(f"{e}_{v}", 0.0) for v in _VELOCITIES] for e in EQUATIONS]
    matrix[1][5] = matrix[1][5] - values["mass"] * values["speed"]
    matrix[2][4] = matrix[2][4] + values["mass"] * values["speed"]
    return matrix


def force(values: Mapping[str, Any], state: Entries, fins: Entries, trig: Trigonometry) -> list[Any]:
    """Fins (rudder, right and left elevator), thrust and restoring; the body floats: weight is buoyancy."""
    sin, cos = trig
    phi, theta = state[6], state[7]
    rudder, right, left = fins
    elevator = 0.5 * (right + left)
    righting = values["z_B"] * values["buoyancy"]
    return [
        values["X_0"],
        values["Y_delta_r"] * rudder,
        values["Z_delta_e"] * elevator,
        values["K_delta_er"] * right - values["K_delta_el"] * left + righting * sin(phi) * cos(theta),
        values["M_delta_e"] * elevator + righting * sin(theta),
        values["N_delta_r"] * rudder,
    ]


def position_rates(state: Entries, trig: Trigonometry) -> list[Any]:
    """Rates of φ, θ, ψ and z."""
    sin, cos = trig
    u, v, w, p, q, r, phi, theta = state[:8]
    turning = (q * sin(phi) + r * cos(phi)) / cos(theta)
    sinking = -u * sin(theta) + (v * sin(phi) + w * cos(phi)) * cos(theta)
    return [p + turning * sin(theta), q * cos(phi) - r * sin(phi), turning, sinking]


def product(matrix: Matrix, vector: Sequence[Any]) -> list[Any]:
    """Matrix times vector, absent entries left out."""
    rows = []
    for row in matrix:
        terms = [a * x for a, x in zip(row, vector, strict=True) if not (isinstance(a, float) and a == 0.0)]
        rows.append(sum(terms[1:], terms[0]) if terms else 0.0)
    return rows
