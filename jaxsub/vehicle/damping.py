"""Linear hull damping."""

from collections.abc import Mapping

import equinox as eqx
from jaxtyping import Array, Float

from ..arrays import Values
from .inertia import CENTRE_OF_GRAVITY, place, sparse


class Damping(eqx.Module):
    r"""$\tilde A$ (the first paper's eq. 1): the linear derivatives `X_u` … `N_r` and the terms of going around.

    Those are the centripetal $-mU_c r$ in sway and $+mU_c q$ in heave. Where the origin is not the centre of gravity,
    $mU_c(z_G r + y_G q)$ in roll, $-mU_c x_G q$ in pitch and $-mU_c x_G r$ in yaw come with them.

    **Fields**

    - `coefficients`: SI, by ASCII SNAME.
    """

    coefficients: dict[str, Float[Array, ""]]

    def matrix(self, rigid: Mapping[str, Values], cruise: Values) -> Float[Values, "6 6"]:
        """The 6 × 6 matrix at the operating speed `cruise` m/s, of a body as `Inertia.rigid` has it."""
        around = rigid["mass"] * cruise
        turning = [(1, 5, -around), (2, 4, around)]
        if "x_G" in rigid:
            x, y, z = (around * rigid[name] for name in CENTRE_OF_GRAVITY)
            turning += [(3, 5, z), (3, 4, y), (4, 4, -x), (5, 5, -x)]
        return sparse([*turning, *self.own()])

    def own(self) -> list[tuple[int, int, Values]]:
        """Row, column and value of each linear derivative."""
        return [(*place(name), value) for name, value in self.coefficients.items()]
