r"""The whitened Jacobian of a fit by relative changes of its coefficients, and the directions that it leaves open.

With $J$ the whitened residuals' Jacobian by $\theta_i/|\theta_i|$, initial states eliminated and priors counted as
observations, $J = U\,\mathrm{diag}(s)\,V^T$: the direction $v_k$ is known to $1/s_k$ of the coefficients' own sizes. It
is identified where that is below `FRACTION`, a half: a coefficient alone would then have an interval of 95 % that keeps
its sign. And $s_k$ has to be above the rounding of the Jacobian, the end of a long recursion: half the digits of the
float type, below the largest. A direction under that is told by nothing, however small the noise.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..estimate import Fit, Problem
from ..likelihood import Linearised
from .coloured import whitened_columns

FRACTION = 0.5
# shares in a hidden direction below this are rounding
_ZERO = 1e-6


@dataclasses.dataclass(frozen=True)
class Directions:
    """Directions of relative change, the least known first.

    **Fields**

    - `names`, `size`: of the p coefficients, and what counts as all of each: its value, or where that is zero the
      file's, or where both are its standard error.
    - `triangle`: (p, p) R of the Jacobian's QR decomposition, by relative changes.
    - `vectors`: (p, p), a direction in each column; `uncertainty`: (p,) of each, infinite where rounding hides it.
    """

    names: tuple[str, ...]
    size: np.ndarray
    triangle: np.ndarray
    vectors: np.ndarray
    uncertainty: np.ndarray

    @classmethod
    def of(cls, fit: Fit) -> "Directions":
        """The directions of a fit."""
        problem = fit.problem
        values, given = np.array(list(fit.values.values())), np.asarray(problem.prior_mean)
        size = np.maximum(np.abs(values), np.where(np.isfinite(given), np.abs(given), 0.0))
        size = np.where(size > 0.0, size, np.array(list(fit.standard_errors.values())))
        triangle = np.asarray(_triangle(problem, fit.model)) * size
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
    told = singular > np.sqrt(np.finfo(singular.dtype).eps) * largest
    return np.where(told, 1.0 / np.where(told, singular, 1.0), np.inf)


def _spread(vectors: np.ndarray, uncertainty: np.ndarray) -> np.ndarray:
    """Standard error of each coefficient from those of the directions."""
    hidden = ~np.isfinite(uncertainty)
    known = np.sqrt(np.sum((vectors * np.where(hidden, 0.0, uncertainty)) ** 2, axis=1))
    return np.where(np.any(np.abs(vectors[:, hidden]) > _ZERO, axis=1), np.inf, known)


@eqx.filter_jit
def _triangle(problem: Problem, model: Linearised) -> Float[Array, "p p"]:
    """R of the whitened Jacobian by the coefficients, physical units, the initial states eliminated."""
    theta, start, _ = whitened_columns(problem, model)
    s, p = start.shape[-1], theta.shape[-1]

    def left(theta: Array, start: Array) -> Array:
        """What no initial state, nor its prior, can follow."""
        states = jnp.concatenate([start.reshape(-1, s), jnp.eye(s)])
        columns = jnp.concatenate([theta.reshape(-1, p), jnp.zeros((s, p))])
        basis = jnp.linalg.qr(states)[0]
        return columns - basis @ (basis.T @ columns)

    rows = jax.vmap(left)(theta, start).reshape(-1, p)
    return jnp.linalg.qr(jnp.concatenate([rows, jnp.diag(1.0 / problem.prior_std)]), mode="r")
