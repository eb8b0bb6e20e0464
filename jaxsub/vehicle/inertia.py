"""Rigid-body and added inertia."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace
from ..effects import EQUATIONS, VELOCITIES

RIGID = ("mass", "mass", "mass", "I_x", "I_y", "I_z")
CENTRE_OF_GRAVITY = ("x_G", "y_G", "z_G")


class Inertia(eqx.Module):
    r"""$\tilde M = M_{RB} - \{X_{\dot u}, …, N_{\dot r}\}$ about the body's origin (the first paper's eq. 1).

    The origin is the centre of gravity where that is not given. Else $M_{RB}$ has $\mp m S(r_G)$ beside its diagonal.

    Potential flow makes the added mass symmetric, so a coefficient given on one side only (`Y_rdot`) stands for its
    twin (`N_vdot`) too; where a source prints both, both are kept as printed.

    **Fields**

    - `rigid`: `mass` kg, `I_x I_y I_z` kg m² about the origin; `x_G y_G z_G` m, or none of them.
    - `added`: coefficients such as `Y_vdot`, SI.
    """

    rigid: dict[str, Float[Array, ""]]
    added: dict[str, Float[Array, ""]]

    def body_matrix(self) -> Float[Values, "6 6"]:
        """The 6 × 6 inertia matrix of the rigid body alone."""
        xp = namespace(*self.rigid.values())
        diagonal = xp.diag(xp.stack([self.rigid[name] for name in RIGID]))
        if "x_G" not in self.rigid:
            return diagonal
        x, y, z = (self.rigid["mass"] * self.rigid[name] for name in CENTRE_OF_GRAVITY)
        upper = [(0, 4, z), (0, 5, -y), (1, 3, -z), (1, 5, x), (2, 3, y), (2, 4, -x)]
        return diagonal + sparse([*upper, *((column, row, value) for row, column, value in upper)])

    def matrix(self) -> Float[Values, "6 6"]:
        """The 6 × 6 inertia matrix."""
        rigid, entries = self.body_matrix(), []
        for name, value in self.added.items():
            row, column = place(name)
            entries.append((row, column, value))
            if row != column and twin(name) not in self.added:
                entries.append((column, row, value))
        return rigid - sparse(entries)


def place(name: str) -> tuple[int, int]:
    """Row and column of the coefficient `name`, such as `Y_rdot`, in a 6 × 6 matrix."""
    return "XYZKMN".index(name[0]), "uvwpqr".index(name[2])


def sparse(entries: Sequence[tuple[int, int, Values | np.generic]]) -> Float[Values, "6 6"]:
    """The 6 × 6 matrix with each value of `entries` added at its row and column.

    One contraction with a constant: a scatter for each is dozens of operations to compile in every use of the model.
    """
    xp = namespace(*(value for _, _, value in entries))
    if not entries:
        return xp.zeros((6, 6), jnp.result_type(float))
    basis = np.zeros((len(entries), 6, 6))
    for ones, (row, column, _) in zip(basis, entries, strict=True):
        ones[row, column] = 1.0
    values = xp.stack([value for _, _, value in entries])
    return xp.tensordot(values, basis.astype(values.dtype), 1)


def twin(name: str) -> str:
    """The coefficient that potential flow makes equal: `Y_rdot` for `N_vdot`."""
    row, column = place(name)
    return f"{'XYZKMN'[column]}_{'uvwpqr'[row]}dot"


def indefinite(matrix: np.ndarray, equations: tuple[str, ...], names: list[str]) -> list[str]:
    """The coefficients that make `matrix` (n, n) indefinite; empty where its symmetric part is positive definite.

    They are those in the rows that dominate the eigenvector of the most negative eigenvalue.
    """
    # a sum of what is near the largest float would overflow
    values, vectors = np.linalg.eigh(0.5 * matrix + 0.5 * matrix.T)
    if values[0] > 0.0:
        return []
    weight = np.abs(vectors[:, 0])
    guilty = [equations[i] for i in np.argsort(-weight) if weight[i] > 0.3 * weight.max()]
    letters = {VELOCITIES.get(e, e) for e in guilty} | {"XYZKMN"[EQUATIONS.index(e)] for e in guilty if e in EQUATIONS}
    return [n for n in names if n[0] in letters or n[2:].removesuffix("dot") in letters] or list(guilty)
