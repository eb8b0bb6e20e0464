"""Linear hull damping."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

_ROWS = dict(zip("XYZKMN", range(6), strict=True))
_COLUMNS = dict(zip("uvwpqr", range(6), strict=True))


class Damping(eqx.Module):
    r"""$\tilde A$ (equations.md §1): the linear derivatives `X_u` … `N_r` and the terms of going around.

    Those are the centripetal $-mU_c r$ in sway and $+mU_c q$ in heave.

    **Fields**

    - `coefficients`: SI, by ASCII SNAME.
    """

    coefficients: dict[str, Float[Array, ""]]

    def matrix(self, mass: Array, cruise: Array) -> Float[Array, "6 6"]:
        """The 6 × 6 matrix for a body of `mass` kg at the operating speed `cruise` m/s."""
        matrix = jnp.zeros((6, 6), jnp.result_type(float)).at[1, 5].add(-mass * cruise).at[2, 4].add(mass * cruise)
        for name, value in self.coefficients.items():
            matrix = matrix.at[_ROWS[name[0]], _COLUMNS[name[2]]].add(value)
        return matrix
