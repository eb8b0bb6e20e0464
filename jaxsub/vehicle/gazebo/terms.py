"""Names of the hydrodynamics plugin's coefficients, and the derivatives that they are.

The plugin adds the force $F_i = \\sum_j X_{\\dot j}\\dot\\nu_j + \\sum_j X_j\\nu_j + \\sum_{jk} X_{jk}\\nu_j\\nu_k +
\\sum_{jk} X_{j|k|}\\nu_j|\\nu_k| + (C\\nu)_i$ in the link's axes. Source: gz-sim 8, `Hydrodynamics.cc`.
"""

import re

import numpy as np

from ...effects import EQUATIONS, derivative

AXES, FORCES, RATES = "UVWPQR", "XYZKMN", "uvwpqr"
_ROWS = FORCES.lower()
# of a half turn about x, by equation
SIGNS = (1.0, -1.0, -1.0, 1.0, -1.0, -1.0)
FLIP = np.diag(SIGNS[:3])
_TAG = re.compile(r"([xyzkmn])(?:Dot([UVWPQR])|([UVWPQR])(abs)?([UVWPQR])?)")

# Cν of the plugin by the added mass of the diagonal. Signs are opposite to those of Fossen's -C_A(ν)ν but for X_vr, and
# N_uw stands where he has Y_vdot u v
CORIOLIS = {
    "X_wq": "-Z_wdot",
    "X_vr": "-Y_vdot",
    "Y_wp": "Z_wdot",
    "Y_ur": "-X_udot",
    "Z_vp": "-Y_vdot",
    "Z_uq": "X_udot",
    "K_vw": "Y_vdot - Z_wdot",
    "K_qr": "M_qdot - N_rdot",
    "M_uw": "Z_wdot - X_udot",
    "M_pr": "N_rdot - K_pdot",
    "N_uw": "Z_wdot",
    "N_uv": "X_udot",
    "N_pq": "K_pdot - M_qdot",
}


def symbol(tag: str) -> tuple[str, float] | None:
    """The derivative that the plugin's element `tag`, such as `xUabsV`, is, and its sign in our axes; None if none."""
    if (found := _TAG.fullmatch(tag)) is None:
        return None
    force, rate, first, absolute, second = found.groups()
    row = _ROWS.index(force)
    if rate:
        return f"{FORCES[row]}_{RATES[AXES.index(rate)]}dot", SIGNS[row] * SIGNS[AXES.index(rate)]
    sign, name = SIGNS[row] * SIGNS[AXES.index(first)], f"{FORCES[row]}_{RATES[AXES.index(first)]}"
    if second:
        other = RATES[AXES.index(second)]
        name += f"|{other}|" if absolute else other
        sign *= 1.0 if absolute else SIGNS[AXES.index(second)]
    term = derivative(name)
    assert term is not None
    return term.name, sign


def tag(name: str) -> tuple[str, float] | None:
    """The plugin's element for the derivative `name`, and its sign there; None for what the plugin does not have."""
    term = derivative(name)
    if term is None or not set(term.variables) <= set(EQUATIONS) or not 1 <= len(term.variables) <= 2:
        return None
    row, columns = EQUATIONS.index(term.equation), [EQUATIONS.index(variable) for variable in term.variables]
    sign, letters = SIGNS[row] * SIGNS[columns[0]], [AXES[column] for column in columns]
    if term.rate or len(columns) == 1:
        linear = term.rate or term.powers[0].odd
        return (f"{_ROWS[row]}{'Dot' if term.rate else ''}{letters[0]}", sign) if linear else None
    # the factor that is absolute comes last; |v|v is one power that keeps its sign
    absolute = [power.variable for power in term.powers if not power.smooth]
    if len(term.powers) == 2 and len(absolute) == 1:
        columns.sort(key=lambda column: EQUATIONS[column] in absolute)
        sign, letters = SIGNS[row] * SIGNS[columns[0]], [AXES[column] for column in columns]
    elif len(absolute) > 1:
        return None
    if not absolute:
        return f"{_ROWS[row]}{letters[0]}{letters[1]}", sign * SIGNS[columns[1]]
    return f"{_ROWS[row]}{letters[0]}abs{letters[1]}", sign
