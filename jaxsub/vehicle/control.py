"""Forces of control surfaces and propulsion."""

from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array, Float

from ..effects import EQUATIONS, Signal

FIN_SYMBOLS = {
    "rudder": "delta_r",
    "elevator_right": "delta_er",
    "elevator_left": "delta_el",
    "elevator": "delta_e",
    "stern_plane": "delta_s",
}
ACTUATORS = (*FIN_SYMBOLS, "thrust", "shaft_speed")


class Control(eqx.Module):
    r"""$\tilde B\delta$ and the constants (equations.md §1).

    `Z_delta_e` and `M_delta_e` act on the mean of right and left elevator; `K_delta_el` enters with a minus, as the
    paper has it. `thrust` (N) pushes in surge; `shaft_speed` (rad/s) does so through `X_nn` as $X_{nn}|n|n$.

    **Fields**

    - `coefficients`: `Y_delta_r`, `K_delta_er`, …, `X_0` … `N_0`, `X_nn`; SI.
    """

    coefficients: dict[str, Float[Array, ""]]

    def force(self, actuators: Mapping[str, Signal]) -> dict[str, Signal]:
        """Generalised force by equation for the deflections `actuators` (rad, N, rad/s), any leading axes."""
        total: dict[str, Signal] = {}
        for name, value in self.coefficients.items():
            equation = EQUATIONS["XYZKMN".index(name[0])]
            total[equation] = total.get(equation, 0.0) + value * _regressor(name, actuators)
        if "thrust" in actuators:
            total["surge"] = total.get("surge", 0.0) + actuators["thrust"]
        return total


def _regressor(name: str, actuators: Mapping[str, Signal]) -> Signal | float:
    """What the coefficient `name` multiplies."""
    symbol = name[2:]
    if symbol == "0":
        return 1.0
    if symbol == "nn":
        return abs(actuators["shaft_speed"]) * actuators["shaft_speed"]
    if symbol == "delta_e" and "elevator" not in actuators:
        return 0.5 * (actuators["elevator_right"] + actuators["elevator_left"])
    fin = next(fin for fin, fin_symbol in FIN_SYMBOLS.items() if fin_symbol == symbol)
    return -actuators[fin] if name == "K_delta_el" else actuators[fin]


def needs(name: str) -> tuple[tuple[str, ...], ...]:
    """The sets of actuators, any one of which the coefficient `name` can act through; empty for a constant."""
    symbol = name[2:]
    if symbol == "0":
        return ()
    if symbol == "nn":
        return (("shaft_speed",),)
    if symbol == "delta_e":
        return (("elevator",), ("elevator_right", "elevator_left"))
    return tuple((fin,) for fin, fin_symbol in FIN_SYMBOLS.items() if fin_symbol == symbol)
