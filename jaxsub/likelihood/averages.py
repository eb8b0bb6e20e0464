r"""Means of a system's samples over groups of them, which show all that a disturbance does slowly.

In open loop, errors of heading and position integrate: a force that a window of samples cannot show dominates a run of
many windows. The whole run shows it, and needs no more than the means of groups of its samples: with $x_0$ the state
at a group's first sample and a force that is linear in time between the group's ends,

$x_m = \Phi x_0 + \Gamma[d_0, d_m],\quad
\bar e = N^{-1/2}\sum_{k<m} e_k = S x_0 + T[d_0, d_m] + \kappa\bar v$

with N the samples that were measured, so that $\bar v$ is white noise of unit variance as each $v_k$ is.
"""

from collections.abc import Iterable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..programs import compiled
from .disturbance import Columns, Disturbance, System
from .run_shares import share_of
from .sensitivity import propagate


class Averages(eqx.Module):
    """Means over J groups of samples of R runs.

    **Fields**

    - `system`: of [x, means of the group before], s + c states, at the J + 1 ends of groups.
    - `columns`: their means, zero at the first end.
    - `interval`, `duration`: mean time between samples and between ends of groups, s.
    """

    system: System
    columns: Columns
    interval: Float[Values, ""]
    duration: Float[Values, ""]

    @classmethod
    def joined(cls, parts: Iterable[tuple[System, Float[Values, "r j1 c q"]]], samples: int) -> "Averages":
        """The `group_means` of consecutive blocks, `parts`, which have so many `samples` of all runs."""
        systems, shown = zip(*jax.device_get(list(parts)), strict=True)
        along = lambda arrays: np.concatenate(arrays, axis=1)
        # the end of a block is where the next begins
        ends = lambda arrays: along([arrays[0][:, :1], *(array[:, 1:] for array in arrays)])
        between = {name: along([getattr(one, name) for one in systems]) for name in ("A", "G", "intervals")}
        at = {name: ends([getattr(one, name) for one in systems]) for name in ("C", "measured")}
        system = System(**jax.device_put(between | at | {"start_std": systems[0].start_std}))
        whole = float(np.sum(between["intervals"]))
        interval, duration = whole / samples, whole / int(np.sum(between["intervals"] > 0.0))
        return cls(system, Columns(jnp.asarray(ends(shown))), jnp.asarray(interval), jnp.asarray(duration))

    def share(self, runs: slice) -> "Averages":
        """Some of the runs, and beyond the last one such in which nothing is measured. Not to be called in `jit`."""
        system, columns = self.system.share(runs), share_of(self.columns, runs)
        return Averages(system, columns, self.interval, self.duration)

    def resampled(self, disturbance: Disturbance) -> Disturbance:
        r"""The `disturbance` given at the ends of groups that is as intense at frequency zero.

        A sequence $\rho^{|k|}$ at interval Δ, linear in between, has the intensity $q^2\Delta\coth(\Delta/2\tau)$.
        """
        inverse = lambda interval: jnp.tanh(0.5 * interval / disturbance.time) / interval
        share = inverse(self.duration) / inverse(self.interval)
        return Disturbance(disturbance.force * jnp.sqrt(share), disturbance.time, disturbance.noise)


@compiled
def group_means(system: System, shown: Float[Array, "r k c q"], groups: int) -> tuple[System, Float[Array, "r j1 c q"]]:
    """The `groups` groups that the intervals of a block of `system` make, as `Averages` has them, and means of `shown`.

    `shown` (R, K, c, q) are columns. Each sample belongs to the group whose interval it begins, so the last one to
    none.
    """
    (r, k1), s, c = system.intervals.shape, system.A.shape[-1], system.C.shape[2]
    n, length = system.G.shape[-1] // 2, -(-k1 // groups)

    def grouped(M: Array, filling: Array | bool | float = 0.0) -> Array:
        padded = jnp.concatenate([M[:, :k1], jnp.broadcast_to(filling, (r, groups * length - k1, *M.shape[2:]))], 1)
        return padded.reshape(r * groups, length, *M.shape[2:])

    back = lambda M: M.reshape(r, groups, *M.shape[1:])
    intervals, C = grouped(system.intervals), grouped(system.C)
    ends = jnp.pad(jnp.cumsum(intervals, axis=1), [(0, 0), (1, 0)])
    share = ends / jnp.where(ends[:, -1:] > 0.0, ends[:, -1:], 1.0)
    before, after = share[:, :-1, None, None], share[:, 1:, None, None]
    begin, end = jnp.split(grouped(system.G), 2, axis=-1)
    forcing = jnp.concatenate([begin * (1.0 - before) + end * (1.0 - after), begin * before + end * after], axis=-1)
    own = jnp.concatenate([jnp.zeros((r * groups, length, s, s)), forcing], axis=-1)
    start = jnp.broadcast_to(jnp.eye(s, s + 2 * n), (r * groups, s, s + 2 * n))
    states = propagate(grouped(system.A, jnp.eye(s)), own, start)
    count = jnp.sum(grouped(system.measured, False), axis=1)
    weight = 1.0 / jnp.sqrt(jnp.maximum(count, 1))[..., None]
    means = weight * jnp.sum(C @ states[:, :-1], axis=1)
    both = back(jnp.concatenate([states[:, -1], means], axis=1))
    A = jnp.concatenate([both[..., :s], jnp.zeros((r, groups, s + c, c))], axis=-1)
    measured = jnp.pad(back(count > 0), [(0, 0), (1, 0), (0, 0)])
    seen = jnp.concatenate([jnp.zeros((c, s)), jnp.eye(c)], axis=1) * measured[..., None]
    start_std = jnp.concatenate([system.start_std, jnp.zeros(c)])
    shown = jnp.pad(back(weight * jnp.sum(grouped(shown), axis=1)), [(0, 0), (1, 0), (0, 0), (0, 0)])
    return System(A, both[..., s:], seen, measured, back(ends[:, -1]), start_std), shown
