r"""The whitened Jacobian of a fit by relative changes of its coefficients, and the directions that it leaves open.

With $J$ the whitened residuals' Jacobian by $\theta_i/|\theta_i|$, initial states eliminated and priors counted as
observations, $J = U\,\mathrm{diag}(s)\,V^T$: the direction $v_k$ is known to $1/s_k$ of the coefficients' own sizes. It
is identified where that is below `FRACTION`, a half: a coefficient alone would then have an interval of 95 % that keeps
its sign. And $s_k$ has to be above the rounding of the Jacobian, the end of a long recursion: half the digits of the
float type, below the largest. A direction under that is unidentifiable, however small the noise.
"""

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import Problem, Solution
from ..likelihood import BlockLinearised, Linearised
from ..likelihood.blocks import Watch, nobody
from ..programs import compiled
from ..recording.runs import Runs
from .residual_disturbance import Noise, whitened_columns

# standard error over a coefficient's size up to which it is identified
FRACTION = 0.5
# shares in a hidden direction below this are rounding
_ZERO = 1e-6


@dataclasses.dataclass(frozen=True)
class Directions:
    """Directions of relative change, the least known first.

    **Fields**

    - `names`, `size`: of the p coefficients, and what counts as all of each: its value or the file's, whichever is
      larger; of one that is zero in the file, such as a sensor's offset, its prior standard deviation at least; its
      standard error where all those are zero.
    - `triangle`: (p, p) R of the Jacobian's QR decomposition, by relative changes.
    - `vectors`: (p, p), a direction in each column; `uncertainty`: (p,) of each, infinite where rounding hides it.
    """

    names: tuple[str, ...]
    size: np.ndarray
    triangle: np.ndarray
    vectors: np.ndarray
    uncertainty: np.ndarray

    @classmethod
    def of(cls, fit: Solution, watch: Watch = nobody) -> "Directions":
        """The directions of a fit. `watch` is called with the share of the samples that is done."""
        problem = fit.problem
        values, given = np.array(list(fit.values.values())), np.asarray(problem.prior_mean)
        size = np.maximum(np.abs(values), np.where(np.isfinite(given), np.abs(given), 0.0))
        rows = {row.name: row for row in fit.vehicle.layout.free}
        spread = np.array([rows[name].prior_std for name in fit.names])
        size = np.where((given == 0.0) & np.isfinite(spread), np.maximum(size, spread), size)
        size = np.where(size > 0.0, size, np.array(list(fit.standard_errors.values())))
        triangle = _triangle(problem, fit.model, watch) * size
        return cls(fit.names, size, triangle, *_decompose(triangle))

    @property
    def open(self) -> np.ndarray:
        """(p,) whether each direction is left open."""
        return self.uncertainty > FRACTION

    @property
    def largest(self) -> float:
        """The best known direction's information: the triangle's largest singular value."""
        return float(np.linalg.norm(self.triangle, 2))

    def relative_errors(self, held: tuple[int, ...] = (), pinned: np.ndarray | None = None) -> np.ndarray:
        """(p,) standard error of each coefficient in its own size; infinite where rounding hides it.

        With the coefficients numbered `held` at their values, and the rows `pinned` (f, p) of relative change known.
        """
        triangle = self.triangle
        if pinned is not None and len(pinned):
            # as if each had been observed a million times better than the best direction
            weight = 1e6 * self.largest
            triangle = np.concatenate([triangle, weight * np.linalg.svd(pinned, full_matrices=False)[2]])
        kept = [i for i in range(len(self.names)) if i not in held]
        vectors, uncertainty = _decompose(triangle[:, kept], self.largest)
        errors = np.zeros(len(self.names))
        errors[kept] = _spread(vectors, uncertainty)
        return errors

    def error_of(self, slope: np.ndarray) -> float:
        """Standard error of what changes by `slope` (p,) with relative changes; infinite where rounding hides it."""
        hidden, shares = ~np.isfinite(self.uncertainty), slope @ self.vectors
        if np.any(np.abs(shares[hidden]) > _ZERO * np.linalg.norm(slope)):
            return float(np.inf)
        return float(np.linalg.norm(shares[~hidden] * self.uncertainty[~hidden]))

    def alone(self) -> np.ndarray:
        """(p,) standard error of each coefficient in its own size if all the others were known."""
        return _inverse(np.linalg.norm(self.triangle, axis=0), self.largest)

    def moves(self, index: int) -> np.ndarray:
        """(p,) the relative change of each coefficient that the data would not notice in one of `index`, by 1."""
        hidden = ~np.isfinite(self.uncertainty)
        widest = np.max(self.uncertainty[~hidden], initial=1.0)
        vectors = np.where(hidden & (np.abs(self.vectors) < _ZERO), 0.0, self.vectors)
        column = vectors @ (np.where(hidden, 1e3 * widest, self.uncertainty) ** 2 * vectors[index])
        return column / column[index]


def subset(directions: Directions, inertial: tuple[str, ...]) -> tuple[str, ...]:
    """The coefficients to hold so that every direction of the rest is identified, those named `inertial` first.

    Chan's (1987) rank-revealing QR: as long as a direction is open, of the coefficients that share in the least known
    one the one with the largest share is put behind the others.
    """
    held: list[int] = []
    while True:
        kept = [i for i in range(len(directions.names)) if i not in held]
        vectors, uncertainty = _decompose(directions.triangle[:, kept], directions.largest)
        if not len(kept) or not uncertainty[0] > FRACTION:
            return tuple(directions.names[i] for i in sorted(held))
        share = np.abs(vectors[:, 0])
        preferred = np.array([directions.names[i] in inertial for i in kept]) & (share > 0.1 * share.max())
        held.append(kept[int(np.argmax(np.where(preferred, 1.0 + share, share)))])


def _decompose(triangle: np.ndarray, largest: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Directions in columns, the least known first, and how far each is known."""
    if not triangle.shape[1]:
        return np.zeros((0, 0)), np.zeros(0)
    _, singular, rows = np.linalg.svd(triangle)
    singular = np.concatenate([singular, np.zeros(triangle.shape[1] - len(singular))])
    return rows[::-1].T, _inverse(singular, singular.max() if largest is None else largest)[::-1]


def _inverse(singular: np.ndarray, largest: float) -> np.ndarray:
    """1 / singular, infinite where it is rounding beside the `largest`."""
    determined = singular > np.sqrt(np.finfo(singular.dtype).eps) * largest
    return np.where(determined, 1.0 / np.where(determined, singular, 1.0), np.inf)


def _spread(vectors: np.ndarray, uncertainty: np.ndarray) -> np.ndarray:
    """Standard error of each coefficient from those of the directions."""
    hidden = ~np.isfinite(uncertainty)
    known = np.sqrt(np.sum((vectors * np.where(hidden, 0.0, uncertainty)) ** 2, axis=1))
    return np.where(np.any(np.abs(vectors[:, hidden]) > _ZERO, axis=1), np.inf, known)


def _triangle(problem: Problem, model: BlockLinearised, watch: Watch) -> Float[np.ndarray, "p p"]:
    """R of the whitened Jacobian by the coefficients, physical units, the initial states eliminated.

    By decompositions of blocks and of what they leave: products would lose half the digits. The prior of the initial
    states is another block.
    """
    p, s = len(problem.prior_mean), len(problem.start_std)
    noise, left, size = Noise.of(problem), [], model.shares[0].stop
    for number in range(len(model.shares)):
        own = np.broadcast_to(np.eye(s, s + p), (size, s, s + p))
        for index in range(model.blocks):
            own = _upper(np.concatenate([own, _block_triangle(noise, *model.block(number, index))], axis=1))
            watch((number + (index + 1) / model.blocks) / len(model.shares))
        left.append(own[:, s:, s:].reshape(-1, p))
    return _upper(np.concatenate([*left, np.diag(1.0 / np.asarray(problem.prior_std))]))


def _upper(matrix: Float[np.ndarray, "*r n q"]) -> Float[np.ndarray, "*r m q"]:
    """R of the decompositions of matrices."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))


@compiled
def _block_triangle(noise: Noise, runs: Runs, model: Linearised) -> Float[Array, "r q q"]:
    """R of each run's whitened columns in one block: by its initial state, then by the coefficients."""
    theta, start, _ = whitened_columns(noise, runs, model)
    columns = jnp.concatenate([start, theta], axis=-1)
    return jnp.linalg.qr(columns.reshape(len(columns), -1, columns.shape[-1]), mode="r")
