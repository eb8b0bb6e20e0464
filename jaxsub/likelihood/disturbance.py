r"""A disturbance force in every equation, and how large and how slow the residuals say it is.

Residuals of a vehicle are sums of its answers to forces that the model does not know: they are correlated over channels
and time and, where a state integrates (heading, depth), not stationary. So they are not described as a series with an
autocorrelation but as what the linearised model makes of first-order Gauss–Markov forces (Gelb 1974, ch. 2):

$x_{k+1} = A_k x_k + G_k[d_k, d_{k+1}],\quad d_{k+1} = \rho_k d_k + q\sqrt{1-\rho_k^2}\,w_k,\quad
\rho_k = e^{-\Delta_k/\tau},\quad e_k = C_k x_k + \kappa v_k$

with q, τ of each equation and the white noise κ of each channel. They maximise the restricted likelihood (Patterson and
Thompson 1971), which a Kalman filter of [x, d] gives: coefficients that are fitted to the same samples take up part of
the disturbance, and the restricted likelihood allows for that.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Bool, Float

from ..arrays import Values, namespace
from ..programs import compiled
from ..recording.runs import Runs
from .innovation_products import Steps, beyond, innovation_products, passes, products_by_part
from .run_shares import by_share, share_of
from .sensitivity import Jacobians, Linearised, propagate

# columns that the narrowest programs take, since fewer take hardly less time; and those from which their number is
# padded to a multiple of so many
_LEAST, _WIDE, _STEP = 32, 256, 64


class Disturbance(eqx.Module):
    """First-order Gauss–Markov forces and white noise.

    **Fields**

    - `force`, `time`: (n,) standard deviation (N, N m) and time constant (s) of the force in each equation.
    - `noise`: (c,) white noise of each channel, in units of the noise that the residuals were whitened with.
    """

    force: Float[Values, " n"]
    time: Float[Values, " n"]
    noise: Float[Values, " c"]


class System(eqx.Module):
    """A model linearised along R runs, s states, c channels in units of their noise, n equations.

    **Fields**

    - `A`: (R, K-1, s, s) of the step by the state, SI. `G`: (R, K-1, s, 2n) by a force at its start and end, SI.
    - `C`: (R, K, c, s) of the channels by the state, noise units per SI unit, zero where nothing was measured.
    - `measured`: (R, K, c) whether it was.
    - `intervals`: (R, K-1) s, 0 where padded. `start_std`: (s,) prior standard deviation of the initial states, SI.
    """

    A: Float[Array, "r k1 s s"]
    G: Float[Array, "r k1 s n2"]
    C: Float[Array, "r k c s"]
    measured: Bool[Array, "r k c"]
    intervals: Float[Array, "r k1"]
    start_std: Float[Array, " s"]

    @classmethod
    def of(
        cls, model: Linearised | Jacobians, runs: Runs, sigma: Float[Array, " c"], start_std: Float[Array, " s"]
    ) -> "System":
        """A linearised `model` on `runs`, its channels in units of `sigma` (c,), SI.

        `start_std` (s,) is the prior standard deviation of the initial states, SI.
        """
        C = model.C * (runs.mask / sigma)[..., None]
        intervals = jnp.where(runs.live, runs.steps[runs.step_of], 0.0)
        return cls(model.A, model.G, C, runs.mask, intervals, start_std)

    def share(self, runs: slice) -> "System":
        """Some of the runs, and beyond the last one such in which nothing is measured. Not to be called in `jit`."""
        return System(*share_of(self.by_run, runs), self.start_std)

    @property
    def by_run(self) -> tuple[Array, Array, Array, Array, Array]:
        """What each run has of its own, in the order of the fields."""
        return self.A, self.G, self.C, self.measured, self.intervals


class Columns(eqx.Module):
    """What residuals are linear in, column by column; the residual itself is one.

    **Fields**

    A column is what it shows plus what the system makes of its forcing.

    - `shown`: (R, K, c, q) in the channels, in units of their noise, zero where nothing was measured.
    - `forcing`: (R, K-1, s, q) on the state in each step, SI; None where `shown` holds that already.
    """

    shown: Float[Values, "r k c q"]
    forcing: Float[Values, "r k1 s q"] | None = None

    def __add__(self, other: "Columns") -> "Columns":
        """Both, side by side; either may lack forcing only if the other does. NumPy arrays stay NumPy arrays."""

        return jax.tree.map(lambda a, b: namespace(a, b).concatenate([a, b], axis=-1), self, other)

    def padded(self, width: int) -> "Columns":
        """With empty columns behind them, `width` in all. NumPy arrays stay NumPy arrays."""
        if width == self.shown.shape[-1]:
            return self
        pad = lambda M: namespace(M).pad(M, [(0, 0)] * (M.ndim - 1) + [(0, width - M.shape[-1])])
        return jax.tree.map(pad, self)


def restricted(gram: Float[Array, "q q"], log_determinant: Float[Array, ""]) -> Float[Array, ""]:
    """Minus the logarithm of the restricted likelihood, up to its constant.

    `gram` (q, q) has the products of the whitened residual and of the columns that are fitted to it, those of their
    priors included; `log_determinant` is half the log-determinant of the residual's covariance.
    """
    among = jnp.linalg.cholesky(gram[1:, 1:])
    explained = solve_triangular(among, gram[1:, 0], lower=True)
    return log_determinant + jnp.sum(jnp.log(jnp.diagonal(among))) + 0.5 * (gram[0, 0] - explained @ explained)


@compiled
def whitened(
    disturbance: Disturbance, system: System, columns: Columns
) -> tuple[Float[Array, "r k c q"], Float[Array, "r k c c"]]:
    """The innovations of all `columns`, whitened, (R, K, c, q), and the lower Cholesky factors of their covariance.

    They are those of a filter of `system` under `disturbance`.
    """
    return passes(*steps(disturbance, system, columns), lambda passed: (passed.white, passed.factor))


def part_products(
    disturbance: Disturbance, system: System, columns: Callable[[slice], Columns], parts: int
) -> tuple[Float[np.ndarray, "r m q q"], Float[np.ndarray, "r m"]]:
    """Products of all `columns` whitened, in each of `parts` of every run; half the log-determinant of each part.

    The innovations are those of `system` under `disturbance`. `columns` gives those of a share of the runs. They are
    padded to one of a few widths, so that one program serves many numbers of them. Not to be called in `jit`.
    """

    own = lambda some: (disturbance, system.share(some), columns(some), parts)
    runs, samples = system.measured.shape[:2]
    found = by_share(_cut_part_products, own, runs, samples)
    products, spreads = (np.concatenate(each)[:runs] for each in zip(*found, strict=True))
    return products, spreads


def _cut_part_products(
    disturbance: Disturbance, system: System, columns: Columns, parts: int
) -> tuple[np.ndarray, np.ndarray]:
    """Those of a share of the runs, less what the columns are padded with."""
    count = columns.shown.shape[-1]
    found, spreads = _part_products(disturbance, system, columns.padded(padded_width(count)), parts)
    return np.asarray(found)[..., :count, :count], np.asarray(spreads)


@compiled
def total_products(
    disturbance: Disturbance, system: System, columns: Columns
) -> tuple[Float[Array, "q q"], Float[Array, ""]]:
    """Products (q, q) of all `columns` whitened, and half the log-determinant of the residuals' covariance.

    The covariance is that of `system` under `disturbance`.
    """
    return innovation_products(*steps(disturbance, system, columns))


def padded_width(count: int) -> int:
    """The least of 32, 48, 64, 96 … 256 and multiples of 64 that is not less than `count`.

    But for the least, at most half as many more; few where the products of very many columns with each other take
    most of the time.
    """
    if count > _WIDE:
        return -(-count // _STEP) * _STEP
    power = max(_LEAST, 1 << (max(count, 1) - 1).bit_length())
    return 3 * power // 4 if count <= 3 * power // 4 and power > _LEAST else power


@compiled
def _part_products(
    disturbance: Disturbance, system: System, columns: Columns, parts: int
) -> tuple[Float[Array, "r m q q"], Float[Array, "r m"]]:
    return products_by_part(*steps(disturbance, system, columns), parts)


def steps(disturbance: Disturbance, system: System, columns: Columns) -> tuple[Steps, Float[Array, "z z"]]:
    """What a filter of the disturbed system needs at each sample, and the covariance of [x, d] that it begins with."""
    F, B, noise, begin = disturbed(disturbance, system)
    return Steps(F, B, system.C, noise, columns.shown, columns.forcing), begin


def disturbed(
    disturbance: Disturbance, system: System
) -> tuple[Float[Array, "r k z z"], Float[Array, "r k z n"], Float[Array, "r k c"], Float[Array, "z z"]]:
    """What of `steps` depends on the disturbance: F, B, the channels' noise, and the covariance at the start."""
    F, B = transition(disturbance, system)
    noise = jnp.where(system.measured, disturbance.noise, 1.0) ** 2
    return beyond(F), beyond(B), noise, jnp.diag(jnp.concatenate([system.start_std, disturbance.force]) ** 2)


def transition(disturbance: Disturbance, system: System) -> tuple[Float[Array, "r k1 z z"], Float[Array, "r k1 z n"]]:
    """F and B of z ← F z + B w for z = [x, d] in every step of a system."""
    return augmented(disturbance, system.A, system.G, system.intervals)


def augmented(
    disturbance: Disturbance, A: Float[Array, "*k s s"], G: Float[Array, "*k s n2"], interval: Float[Array, " *k"]
) -> tuple[Float[Array, "*k z z"], Float[Array, "*k z n"]]:
    """F and B of z ← F z + B w for z = [x, d], where x follows A and the force's start and end G (`System`)."""
    s, n = A.shape[-1], len(disturbance.force)
    rho = jnp.exp(-interval[..., None] / disturbance.time)
    # no time passes where a shorter run is padded, and there the root has no derivative
    lasts = interval[..., None] > 0.0
    fresh = disturbance.force * jnp.where(lasts, jnp.sqrt(1.0 - jnp.where(lasts, rho, 0.0) ** 2), 0.0)
    begin, end = G[..., :n], G[..., n:]
    empty = jnp.zeros((*interval.shape, s + n, s + n))
    diagonal = jnp.eye(n) * rho[..., None]
    F = empty.at[..., :s, :s].set(A).at[..., :s, s:].set(begin + end * rho[..., None, :])
    B = jnp.concatenate([end, jnp.broadcast_to(jnp.eye(n), diagonal.shape)], axis=-2) * fresh[..., None, :]
    return F.at[..., s:, s:].set(diagonal), B


class Adjoint(NamedTuple):
    """The adjoint recursion of `carried` at one sample.

    **Fields**

    - `lever`: (R, s, p) of the weights on the state. `asked`: (R, n, p) theirs on the force, by the interval that
      begins here; `following`: (R, n, p) what later samples ask of it. `total`: (p, p) the sum so far.
    """

    lever: Float[Array, "r s p"]
    asked: Float[Array, "r n p"]
    following: Float[Array, "r n p"]
    total: Float[Array, "p p"]

    @classmethod
    def at_end(cls, runs: int, states: int, forces: int, columns: int) -> "Adjoint":
        """Beyond the last sample."""
        r, s, n, p = runs, states, forces, columns
        # by NumPy, for which no program has to be made
        return cls(*jax.device_put([np.zeros(shape) for shape in ((r, s, p), (r, n, p), (r, n, p), (p, p))]))


def carried(disturbance: Disturbance, system: System, weights: Float[Array, "r k c p"]) -> Float[Array, "p p"]:
    r"""$\sum_r W_r^T\Gamma_r W_r$ with $\Gamma$ the residuals' covariance under `disturbance`, initial states known.

    `system` is the linearised model, and `weights` (R, K, c, p) are W. By the adjoint recursion, one pass backwards
    through each run that keeps no sample: with $\lambda_k$ the weights' lever on the state, $a_k$ theirs on the force
    and $f_k = a_k + \rho_k f_{k+1}$, forces of unit variance contribute $\sum_k a_kf_k^T + f_ka_k^T - a_ka_k^T$.
    """
    end = Adjoint.at_end(len(weights), system.A.shape[-1], len(disturbance.force), weights.shape[-1])
    adjoint = carried_back(disturbance, system, weights, end)
    return carried_to_start(disturbance, adjoint)


def carried_back(disturbance: Disturbance, system: System, weights: Float[Array, "r k c p"], after: Adjoint) -> Adjoint:
    """`carried` from a block's last sample, which `after` may know already by later blocks, to its first."""
    n, intervals = len(disturbance.force), system.intervals.shape[1]
    turned = lambda M: jnp.swapaxes(M, -1, -2)

    def seen(adjoint: Adjoint, k: Array | int) -> Adjoint:
        white = jnp.where(system.measured[:, k], disturbance.noise, 1.0)[..., None] * weights[:, k]
        lever = turned(system.C[:, k]) @ weights[:, k] + adjoint.lever
        return adjoint._replace(lever=lever, total=adjoint.total + jnp.einsum("rcp,rcq->pq", white, white))

    def step(adjoint: Adjoint, k: Array) -> tuple[Adjoint, None]:
        # arrays are indexed and not scanned over, so that none is copied
        asked = adjoint.asked + turned(system.G[:, k, :, n:]) @ adjoint.lever
        following, total = _forced(disturbance, adjoint._replace(asked=asked))
        rho = jnp.exp(-system.intervals[:, k, None] / disturbance.time)
        before = turned(system.G[:, k, :, :n]) @ adjoint.lever
        passed = Adjoint(turned(system.A[:, k]) @ adjoint.lever, before, rho[..., None] * following, total)
        return seen(passed, k), None

    return jax.lax.scan(step, seen(after, intervals), jnp.arange(intervals), reverse=True)[0]


def carried_to_start(disturbance: Disturbance, adjoint: Adjoint) -> Float[Array, "p p"]:
    """`carried`, where the adjoint recursion has come to the first sample."""
    return _forced(disturbance, adjoint)[1]


def _forced(disturbance: Disturbance, adjoint: Adjoint) -> tuple[Float[Array, "r n p"], Float[Array, "p p"]]:
    """What is asked of the force at a sample and later, and the sum with what that contributes."""
    following = adjoint.asked + adjoint.following
    scaled = disturbance.force[:, None] ** 2 * adjoint.asked
    both = jnp.einsum("rnp,rnq->pq", scaled, following)
    return following, adjoint.total + both + both.T - jnp.einsum("rnp,rnq->pq", scaled, adjoint.asked)


def covariance_derivatives(
    disturbance: Disturbance, system: System, weights: Float[Array, "r k c"]
) -> Float[Array, "r k c m"]:
    r"""$\Gamma_i W$ with $\Gamma_i$ the derivatives of the residuals' covariance by log q, log τ and log κ, in order.

    The covariance is that of `system` under `disturbance`; `weights` (R, K, c) are W. A pass backwards for the forces
    that they weigh, and one forwards for what each force, correlated, shows.
    """
    asked = _asked(system, weights[..., None])
    kept = lambda log_time: _correlated(jnp.exp(log_time), system.intervals, asked)[..., 0]
    log_time = jnp.log(disturbance.time)
    # each force depends on its own time constant alone
    by = jax.jvp(kept, (log_time,), (jnp.ones_like(log_time),))
    n, s = len(disturbance.force), system.A.shape[-1]
    forces = jnp.concatenate([2.0 * by[0], by[1]], axis=-1) * jnp.tile(disturbance.force**2, 2)
    both = lambda M: jnp.tile(M, 2)
    forcing = both(system.G[..., :n]) * forces[:, :-1, None] + both(system.G[..., n:]) * forces[:, 1:, None]
    shown = system.C @ propagate(system.A, forcing, jnp.zeros((len(forcing), s, 2 * n), forcing.dtype))
    white = 2.0 * disturbance.noise**2 * weights
    by_noise = white[..., None] * jnp.eye(len(disturbance.noise), dtype=white.dtype)
    return jnp.where(system.measured[..., None], jnp.concatenate([shown, by_noise], axis=-1), 0.0)


def _asked(system: System, weights: Float[Array, "r k c p"]) -> Float[Array, "r k n p"]:
    """The adjoint of the system: what `weights` of its channels weigh of the force at each sample."""
    flip = lambda M: M[:, ::-1]
    shown = flip(jnp.swapaxes(system.C, -1, -2) @ weights)
    transposed = flip(jnp.swapaxes(system.A, -1, -2))
    # a weight on a sample's state joins after the step that leads back to it
    following = propagate(transposed, shown[:, 1:], shown[:, 0])
    begin, end = jnp.split(jnp.swapaxes(system.G, -1, -2) @ flip(following)[:, 1:], 2, axis=2)
    around = lambda M, before: jnp.pad(M, [(0, 0), (before, 1 - before), (0, 0), (0, 0)])
    return around(begin, 0) + around(end, 1)


def _correlated(
    time: Float[Array, " n"], intervals: Float[Array, "r k1"], values: Float[Array, "r k n p"]
) -> Float[Array, "r k n p"]:
    r"""$\sum_m e^{-|t_k-t_m|/\tau}v_m$ at every sample, by a pass each way."""

    def step(before: Array, at: tuple[Array, Array]) -> tuple[Array, Array]:
        rho, value = at
        before = rho[..., None] * before + value
        return before, before

    def forth(rho: Array, values: Array) -> Array:
        return jax.lax.scan(step, jnp.zeros_like(values[0]), (rho, values))[1]

    def run(rho: Array, values: Array) -> Array:
        begin = jnp.zeros_like(rho[:1])
        forwards = forth(jnp.concatenate([begin, rho]), values)
        backwards = forth(jnp.concatenate([begin, rho[::-1]]), values[::-1])[::-1]
        return forwards + backwards - values

    return jax.vmap(run)(jnp.exp(-intervals[..., None] / time), values)
