"""How large an effect is: what it leaves in the outputs once the coefficients have done what they can against it.

The size of an effect is the rms, in sigmas of the most affected channel, of the change that it makes in the training
runs, less its projection on the tangents of the free coefficients and initial states at the true vehicle. A raw change
would count what any refit absorbs and no diagnosis can see.
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.vehicle import AbstractVehicle

from .simulate import Drive, outputs
from .truth import Truth

_COARSE = 4
_GRID = 9
_TOLERANCE = 0.1


class Unabsorbed:
    """The training runs of a true vehicle, ready to say what of a change in them cannot be absorbed."""

    def __init__(self, vehicle: AbstractVehicle, drive: Drive, sigma: np.ndarray):
        self.vehicle, self.drive, self.sigma = vehicle, drive, sigma
        clean, by_theta, by_start = (np.asarray(a) for a in _tangents(vehicle, drive))
        self.clean = clean
        white = lambda a: np.moveaxis(a, 0, -1) / sigma[:, None]
        by_theta, by_start = white(by_theta), white(by_start)
        self.shape = clean.shape
        # initial states belong to a run each, so they are projected off run by run before the coefficients
        flat = lambda a: a.reshape(a.shape[0], -1, a.shape[-1])
        self.starts = [_basis(a) for a in flat(by_start)]
        left = np.stack([a - q @ (q.T @ a) for a, q in zip(flat(by_theta), self.starts, strict=True)])
        self.common = _basis(left.reshape(-1, left.shape[-1]))

    def sigmas(self, changed: np.ndarray) -> float:
        """The size of the change from the clean outputs to `changed` (R, K, c); infinite where those diverge."""
        change = (changed - self.clean) / self.sigma
        if not np.all(np.abs(change) < 1e9):
            return np.inf
        rows = change.reshape(len(change), -1)
        rows = np.stack([row - q @ (q.T @ row) for row, q in zip(rows, self.starts, strict=True)]).ravel()
        left = (rows - self.common @ (self.common.T @ rows)).reshape(self.shape)
        return float(np.sqrt(np.mean(left**2, axis=(0, 1))).max())

    def amplitude(self, truth: Truth, asked: float) -> tuple[float, float]:
        """The size `a` of `truth` that leaves `asked` sigmas, and the sigmas that it leaves; the limit if too small."""
        grid = truth.limit * np.logspace(-4, 0, _GRID)
        for _ in range(2):
            sizes = self._try(truth, grid)
            grid = _bracket(grid, sizes, asked)
            if grid[0] == grid[-1]:
                break
        a = float(_between(grid, self._try(truth, grid), asked))
        return a, self._try(truth, np.full(_GRID, a))[0]

    def largest(self, truth: Truth, sizes: Sequence[float]) -> tuple[float, float]:
        """`amplitude` for the first of `sizes` that `truth` can reach; the size 0 where it can reach none."""
        for asked in sizes:
            amplitude, reached = self.amplitude(truth, asked)
            if abs(reached / asked - 1.0) < _TOLERANCE:
                return amplitude, reached
        return 0.0, 0.0

    def _try(self, truth: Truth, grid: np.ndarray) -> np.ndarray:
        changed = np.asarray(_sweep(self.vehicle, truth, jnp.asarray(grid), self.drive))
        return np.array([self.sigmas(c) for c in changed])


def _bracket(grid: np.ndarray, sizes: np.ndarray, asked: float) -> np.ndarray:
    """A finer grid about the first crossing of `asked`; the limit alone, or all below the grid, where there is none."""
    above = np.flatnonzero(sizes >= asked)
    if not len(above):
        return np.full(_GRID, grid[np.argmax(sizes)])
    if above[0] == 0:
        return np.geomspace(grid[0] * 1e-3, grid[0], _GRID)
    return np.geomspace(grid[above[0] - 1], grid[above[0]], _GRID)


def _between(grid: np.ndarray, sizes: np.ndarray, asked: float) -> float:
    """Where log size crosses log `asked` on `grid`."""
    above = np.flatnonzero(sizes >= asked)
    if not len(above) or above[0] == 0:
        return float(grid[-1] if not len(above) else grid[0])
    low, high = above[0] - 1, above[0]
    if not np.isfinite(sizes[high]):
        return float(grid[low])
    ends = np.log(np.maximum(sizes[[low, high]], 1e-12))
    share = (np.log(asked) - ends[0]) / max(ends[1] - ends[0], 1e-12)
    return float(np.exp(np.log(grid[low]) + share * np.log(grid[high] / grid[low])))


@eqx.filter_jit
def _sweep(vehicle: AbstractVehicle, truth: Truth, grid: jax.Array, drive: Drive) -> jax.Array:
    return jax.vmap(lambda a: outputs(vehicle, (truth,), a[None], drive, _COARSE)[0])(grid)


@eqx.filter_jit
def _tangents(vehicle: AbstractVehicle, drive: Drive) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Clean outputs (R, K, c), their derivatives by the free coefficients (p, R, K, c) and own starts (s, R, K, c)."""
    names = [row.name for row in vehicle.layout.free]
    values = vehicle.values()
    theta = jnp.stack([values[name] for name in names])
    scale = jnp.where(theta == 0.0, 1.0, jnp.abs(theta))

    def shown(relative: jax.Array, nudge: jax.Array) -> jax.Array:
        moved = vehicle.with_values(dict(zip(names, theta + scale * relative, strict=True)))
        begun = drive._replace(start=drive.start + nudge)
        return outputs(moved, (), jnp.zeros(0), begun, _COARSE)[0]

    zero, still = jnp.zeros(len(names)), jnp.zeros(drive.start.shape[1])
    along = lambda f, x: jax.vmap(lambda d: jax.jvp(f, (x,), (d,))[1])(jnp.eye(len(x)))
    return shown(zero, still), along(lambda x: shown(x, still), zero), along(lambda x: shown(zero, x), still)


def _basis(columns: np.ndarray) -> np.ndarray:
    """An orthonormal basis of the columns, those that leave no trace dropped."""
    size = np.linalg.norm(columns, axis=0)
    left, values, _ = np.linalg.svd(columns[:, size > 1e-9] / size[size > 1e-9], full_matrices=False)
    return left[:, values > 1e-7 * values.max(initial=0.0)]
