"""What all samples of the recordings say of the disturbance force and of where the runs began."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arrays import Values
from ..programs import compiled
from .disturbance import Columns, Disturbance, System, transition
from .innovation_products import beyond


class Smoothed(NamedTuple):
    """What all samples of a column say of R runs.

    **Fields**

    - `force`, `deviation`: (R, K, n) the disturbance force (N, N m) and its standard deviation.
    - `start`, `covariance`: (R, s) and (R, s, s) the initial state, less that from which it was linearised, SI.
    """

    force: Float[Array, "r k n"]
    deviation: Float[Array, "r k n"]
    start: Float[Array, "r s"]
    covariance: Float[Array, "r s s"]


@compiled
def smoothed(disturbance: Disturbance, system: System, column: Columns) -> Smoothed:
    """The force of a `disturbance` on `system` that one `column` shows, given all of its samples, and initial states.

    The adjoint form of the smoother, which inverts no covariance of the state. Source: Bierman (1973), Automatica 9.
    """
    F, B = transition(disturbance, system)
    s, n = system.C.shape[-1], len(disturbance.force)
    C = jnp.concatenate([system.C, jnp.zeros((*system.C.shape[:3], n))], axis=-1)
    noise = jnp.where(system.measured, disturbance.noise, 1.0) ** 2

    def forth(carry: tuple[Array, Array], sample: tuple) -> tuple[tuple[Array, Array], tuple]:
        m, P = carry
        F, B, C, noise, shown, forcing = sample
        inverse = jnp.linalg.inv(C @ P @ C.T + jnp.diag(noise))
        error = shown[:, 0] - C @ m
        gain = P @ C.T @ inverse
        after = (F @ (m + gain @ error)).at[:s].add(-forcing[:, 0]), F @ (P - gain @ C @ P) @ F.T + B @ B.T
        known = C.T @ inverse
        return after, (m, P, known @ C, known @ error, jnp.eye(s + n) - gain @ C, F)

    def back(carry: tuple[Array, Array], kept: tuple) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        lever, weight = carry
        m, P, information, pull, left, F = kept
        through = left.T @ F.T
        lever, weight = through @ lever - pull, information + through @ weight @ through.T
        mean, variance = m - P @ lever, jnp.diag(P - P @ weight @ P)
        return (lever, weight), (mean[s:], jnp.sqrt(jnp.maximum(variance[s:], 0.0)))

    def run(*samples: Values) -> Smoothed:
        begin = jnp.diag(jnp.concatenate([system.start_std, disturbance.force]) ** 2)
        _, kept = jax.lax.scan(forth, (jnp.zeros(s + n), begin), samples)
        nothing = jnp.zeros(s + n), jnp.zeros((s + n, s + n))
        (lever, weight), force = jax.lax.scan(back, nothing, kept, reverse=True)
        return Smoothed(*force, (-begin @ lever)[:s], (begin - begin @ weight @ begin)[:s, :s])

    assert column.forcing is not None
    return jax.vmap(run)(beyond(F), beyond(B), C, noise, column.shown, beyond(column.forcing))
