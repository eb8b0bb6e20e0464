r"""A disturbance force in every equation, and how large and how slow the residuals say it is.

Residuals of a free-running model are sums of its answers to forces it does not know: they are correlated over channels
and time and, where a state integrates (heading, depth), not stationary. So they are not described as a series with an
autocorrelation but as what the linearised model makes of first-order Gauss–Markov forces (Gelb 1974, ch. 2):

$x_{k+1} = A_k x_k + G_k[d_k, d_{k+1}],\quad d_{k+1} = \rho_k d_k + q\sqrt{1-\rho_k^2}\,w_k,\quad
\rho_k = e^{-\Delta_k/\tau},\quad e_k = C_k x_k + \kappa v_k$

with q, τ of each equation and the white noise κ of each channel. They maximise the restricted likelihood (Patterson and
Thompson 1971), which a Kalman filter of [x, d] gives: coefficients and initial states that were fitted to the same
samples take up part of the disturbance, and the restricted likelihood allows for that.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Bool, Float

_MAX_STEPS = 150
# standard deviations of weak priors on the logarithms of q, τ and κ: without them an absent force has no optimum
_LOOSE = (5.0, 1.5, 2.0)


class Disturbance(eqx.Module):
    """First-order Gauss–Markov forces and white noise.

    **Fields**

    - `force`, `time`: (n,) standard deviation (N, N m) and time constant (s) of the force in each equation.
    - `noise`: (c,) white noise of each channel, in units of the noise that the residuals were whitened with.
    """

    force: Float[Array, " n"]
    time: Float[Array, " n"]
    noise: Float[Array, " c"]


class Whitened(eqx.Module):
    """Residuals and what they are linear in, whitened, zero where nothing was measured.

    **Fields**

    - `residual`: (R, K, c). `theta`: (R, K, c, p) by the coefficients' independent directions. `start`: (R, K, c, s) by
      the initial states in units of their prior. `prior`: (p + 1, p + 1) Gram matrix of the priors' residual and rows.
    - `A`, `G`, `C`: as of `Linearised`, C whitened. `intervals`: (R, K-1) s. `measured`: (R, K, c).
    """

    residual: Float[Array, "r k c"]
    theta: Float[Array, "r k c p"]
    start: Float[Array, "r k c s"]
    prior: Float[Array, "p1 p1"]
    A: Float[Array, "r k1 s s"]
    G: Float[Array, "r k1 s n2"]
    C: Float[Array, "r k c s"]
    intervals: Float[Array, "r k1"]
    measured: Bool[Array, "r k c"]


@eqx.filter_jit
def estimate_disturbance(data: Whitened, unit: Float[Array, " n"]) -> Disturbance:
    """The disturbance of largest restricted likelihood; the search starts from forces of size `unit`."""
    n, c = unit.shape[0], data.residual.shape[2]
    length = jnp.max(jnp.sum(data.intervals, axis=1))
    slow = jnp.sqrt(length * length / data.intervals.shape[1])
    centre = jnp.concatenate([jnp.log(unit), jnp.full(n, jnp.log(slow)), jnp.zeros(c)])
    loose = jnp.concatenate([jnp.full(m, std) for m, std in zip((n, n, c), _LOOSE, strict=True)])
    samples = jnp.sum(data.measured)
    parts = lambda z: Disturbance(*jnp.split(jnp.exp(centre + z), [n, 2 * n]))

    def cost(z: Array, data: Whitened) -> Array:
        return (restricted(parts(z), data) + 0.5 * jnp.sum((z / loose) ** 2)) / samples

    # sizes to a part in a thousand are far closer than any data tell them
    solver = optx.BFGS(rtol=1e-3, atol=1e-3)
    return parts(optx.minimise(cost, solver, jnp.zeros(2 * n + c), args=data, max_steps=_MAX_STEPS, throw=False).value)


def restricted(disturbance: Disturbance, data: Whitened) -> Float[Array, ""]:
    """Minus the logarithm of the restricted likelihood, up to its constant."""
    columns = jnp.concatenate([data.residual[..., None], data.theta, data.start], axis=-1)
    white, spread = jax.vmap(lambda *run: _filter(disturbance, *run))(
        *_transition(disturbance, data), data.C, data.measured, columns
    )
    p1 = data.theta.shape[3] + 1
    gram = jnp.einsum("rkca,rkcb->rab", white, white)
    own = jnp.linalg.cholesky(gram[:, p1:, p1:] + jnp.eye(data.start.shape[3]))
    taken = jax.vmap(lambda L, m: solve_triangular(L, m, lower=True))(own, gram[:, p1:, :p1])
    left = jnp.sum(gram[:, :p1, :p1], 0) - jnp.einsum("rsa,rsb->ab", taken, taken) + data.prior
    among = jnp.linalg.cholesky(left[1:, 1:])
    explained = solve_triangular(among, left[1:, 0], lower=True)
    logarithm = lambda factor: jnp.sum(jnp.log(jnp.diagonal(factor, axis1=-2, axis2=-1)))
    return jnp.sum(spread) + logarithm(own) + logarithm(among) + 0.5 * (left[0, 0] - explained @ explained)


def carried(disturbance: Disturbance, data: Whitened, weights: Float[Array, "r k c p"]) -> Float[Array, "p p"]:
    r"""$\sum_r W_r^T\Gamma_r W_r$ with $\Gamma$ the residuals' covariance under `disturbance`.

    By the adjoint recursion, one pass backwards through each run, instead of a sum over all pairs of samples.
    """

    def run(F: Array, B: Array, C: Array, measured: Array, W: Array) -> Array:
        s = C.shape[-1]
        shown = jnp.einsum("kcs,kcp->ksp", C, W)

        def back(adjoint: Array, step: tuple[Array, Array, Array]) -> tuple[Array, Array]:
            F, B, shown = step
            return (F.T @ adjoint).at[:s].add(shown), B.T @ adjoint

        last = jnp.zeros((F.shape[1], W.shape[-1])).at[:s].set(shown[-1])
        first, pushes = jax.lax.scan(back, last, (F, B, shown[:-1]), reverse=True)
        begun = disturbance.force[:, None] * first[s:]
        white = jnp.where(measured, disturbance.noise, 1.0)[..., None] * W
        gram = lambda columns: jnp.einsum("...a,...b->ab", columns, columns)
        return gram(pushes) + gram(begun) + gram(white)

    return jnp.sum(jax.vmap(run)(*_transition(disturbance, data), data.C, data.measured, weights), axis=0)


def _transition(disturbance: Disturbance, data: Whitened) -> tuple[Float[Array, "r k1 z z"], Float[Array, "r k1 z n"]]:
    """F and B of z ← F z + B w for z = [x, d]."""
    s, n = data.A.shape[-1], len(disturbance.force)
    rho = jnp.exp(-data.intervals[..., None] / disturbance.time)
    fresh = disturbance.force * jnp.sqrt(1.0 - rho**2)
    begin, end = data.G[..., :n], data.G[..., n:]
    empty = jnp.zeros((*data.intervals.shape, s + n, s + n))
    diagonal = jnp.eye(n) * rho[..., None]
    F = empty.at[..., :s, :s].set(data.A).at[..., :s, s:].set(begin + end * rho[..., None, :])
    B = jnp.concatenate([end, jnp.broadcast_to(jnp.eye(n), diagonal.shape)], axis=-2) * fresh[..., None, :]
    return F.at[..., s:, s:].set(diagonal), B


def _filter(
    disturbance: Disturbance, F: Array, B: Array, C: Array, measured: Array, columns: Array
) -> tuple[Float[Array, "k c q"], Float[Array, ""]]:
    """Whitened innovations of every column of one run, and half the log-determinant of the residuals' covariance."""
    s, n = C.shape[-1], len(disturbance.force)
    noise = jnp.where(measured, disturbance.noise, 1.0) ** 2

    def step(carry: tuple[Array, Array], sample: tuple[Array, ...]) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        P, X = carry
        F, B, C, noise, shown = sample
        across = C @ P[:s]
        factor = jnp.linalg.cholesky(across[:, :s] @ C.T + jnp.diag(noise))
        innovation = jnp.concatenate([shown - C @ X[:s], across], axis=1)
        white = solve_triangular(factor, innovation, lower=True)
        error, gain = white[:, : shown.shape[1]], white[:, shown.shape[1] :]
        P, X = F @ (P - gain.T @ gain) @ F.T + B @ B.T, F @ (X + gain.T @ error)
        return (P, X), (error, jnp.sum(jnp.log(jnp.diag(factor))))

    last = lambda M: jnp.concatenate([M, jnp.zeros_like(M[:1])])
    begin = jnp.zeros((s + n, s + n)).at[s:, s:].set(jnp.diag(disturbance.force**2))
    carry = (begin, jnp.zeros((s + n, columns.shape[-1])))
    _, (white, spread) = jax.lax.scan(step, carry, (last(F), last(B), C, noise, columns))
    return white, jnp.sum(spread)
