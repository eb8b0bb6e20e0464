r"""What the recordings say about the coefficients: rank, and the directions in which they say nothing.

With $I$ the Fisher information of the free coefficients and $D = \mathrm{diag}(|\theta_i|)$, the eigenvectors of $DID$
are relative changes of the coefficients taken together and its eigenvalues $\lambda$ how sharply the recordings tell
them: a direction is known to $1/\sqrt\lambda$ of the coefficients' own sizes. Above 1 it is not known at all.
"""

import dataclasses

import numpy as np

from ..estimate import Fit

_UNKNOWN = 1.0
_SHOWN = 0.15


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """Rank of the scaled Jacobian at the level of the noise, and its null directions.

    **Fields**

    - `rank`, `parameters`: directions the recordings determine, and free parameters.
    - `null_directions`: for each direction left open, the relative change of each coefficient that matters in it.
    - `uncertainty`: of each direction, in the coefficients' own sizes, the worst first.
    """

    rank: int
    parameters: int
    null_directions: list[dict[str, float]]
    uncertainty: list[float]

    def sentences(self) -> list[str]:
        """The verdict in words, a line each."""
        lines = [f"The recordings determine {self.rank} of {self.parameters} directions of the free coefficients."]
        for direction, spread in zip(self.null_directions, self.uncertainty, strict=False):
            terms = " ".join(f"{share:+.2f}·Δ{name}/{name}" for name, share in direction.items())
            lines.append(f"Open to {spread:.0%} of their size: {terms}")
        return lines


def identifiability(fit: Fit) -> Identifiability:
    """The directions that a fit's recordings leave open."""
    values = np.array([fit.values[name] for name in fit.names])
    if not len(values):
        return Identifiability(0, 0, [], [])
    size = np.where(values == 0.0, np.sqrt(np.diag(np.asarray(fit.covariance))), np.abs(values))
    relative = np.asarray(fit.covariance) / np.outer(size, size)
    variances, directions = np.linalg.eigh(0.5 * (relative + relative.T))
    order = np.argsort(-variances)
    spread = np.sqrt(np.maximum(variances[order], 0.0))
    open_ = [i for i, s in zip(order, spread, strict=True) if s > _UNKNOWN]
    null = []
    for i in open_:
        direction = directions[:, i] * np.sign(directions[np.argmax(np.abs(directions[:, i])), i])
        null.append({n: round(float(d), 3) for n, d in zip(fit.names, direction, strict=True) if abs(d) > _SHOWN})
    return Identifiability(len(values) - len(open_), len(values), null, spread.tolist())
