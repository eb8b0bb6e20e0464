"""Linear hull damping."""

import equinox as eqx
from jaxtyping import Array, Float

from ..arrays import Values
from .inertia import place, sparse


class Damping(eqx.Module):
    r"""$\tilde A$ (equations.md §1): the linear derivatives `X_u` … `N_r` and the terms of going around.

    Those are the centripetal $-mU_c r$ in sway and $+mU_c q$ in heave.

    **Fields**

    - `coefficients`: SI, by ASCII SNAME.
    """

    coefficients: dict[str, Float[Array, ""]]

    def matrix(self, mass: Values, cruise: Values) -> Float[Values, "6 6"]:
        """The 6 × 6 matrix for a body of `mass` kg at the operating speed `cruise` m/s."""
        around = mass * cruise
        own = [(*place(name), value) for name, value in self.coefficients.items()]
        return sparse([(1, 5, -around), (2, 4, around), *own])
