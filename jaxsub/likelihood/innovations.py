r"""One-step-ahead predictions of a model along its recordings, by an extended Kalman filter.

An extended Kalman filter of [x, d], d a first-order Gauss–Markov force in each equation, follows every run. What it
expects lies near the truth even where the model misses much, so that whatever is evaluated along its path — the
Jacobians, and the forces of physics that may have been left out — is evaluated at the motion that took place and not
at one to which missing forces drove a free-running model. The forces at a filtered state act on the next sample, and
sensors are looked at through the state that was expected: regressors that know nothing of the noise that they are held
against, so that innovations and columns are independent where the model is right.

Source: Åström (1980), Automatica 16, prediction errors.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag, cho_solve
from jaxtyping import Array, Float, Int

from ..arrays import Values, namespace
from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import Sampled
from ..vehicle import AbstractVehicle
from ..vehicle.base import wrapped
from .disturbance import Columns, Disturbance, System, augmented, padded_width, total_products
from .readings import as_if_prompt, by_readings, readings_of
from .run_shares import by_share, joined, share_of
from .sensitivity import Jacobians, jacobians


class FilteredRuns(eqx.Module):
    """R runs as a filter of a model followed them, linearised along its path.

    **Fields**

    - `expected`: (R, K, s) states before each sample was seen, SI; `filtered`: (R, K, s) after it, SI.
    - `force`: (R, K, n) the disturbance force (N, N m) after each sample.
    - `system`: linearised, steps at the filtered and outputs at the expected states.
    - `residual`: one column, the measured outputs less those expected, and the filter's corrections of the path.
    - `theta`: p columns, by the free parameters.
    - `readings`: (R, K, c) which sample's reading shows each sample, -1 for none (`readings_of`).
    - `products`: (w, w) of the residual and `theta`, whitened under the disturbance, and zeros up to the width w of a
      program; `log_determinant`: half that of the residual's covariance.
    """

    expected: Float[Array, "r k s"]
    filtered: Float[Array, "r k s"]
    force: Float[Array, "r k n"]
    system: System
    residual: Columns
    theta: Columns
    readings: Int[Array, "r k c"]
    products: Float[Array, "w w"]
    log_determinant: Float[Array, ""]


def filter_runs(
    vehicle: AbstractVehicle,
    runs: Runs,
    sigma: Float[Array, " c"],
    disturbance: Disturbance,
    start: Float[Array, "r s"],
    start_std: Float[Array, " s"],
    begin: Float[Values, "r s s"] | None = None,
) -> FilteredRuns:
    """`vehicle` filtered along `runs`, from initial states of mean `start` (R, s), standard deviation `start_std` (s,).

    Both are SI. `sigma` (c,) is the noise of the channels, SI, in whose units the columns are, and `disturbance` that
    of the forces. `begin` (R, s, s) are covariances by which the path is filtered, where the initial states are known
    better than the linear model along it assumes: from a velocity that nothing measures and that may be anything, the
    first samples' noise would lead far from the motion, where no linearisation holds.
    """
    if begin is None:
        begin = np.broadcast_to(np.diag(np.asarray(start_std) ** 2), (*start.shape, start.shape[1]))

    own = lambda some: (vehicle, runs.share(some), sigma, disturbance, *share_of((start, begin), some), start_std)
    parts = by_share(_filtered_share, own, *runs.times.shape)
    own = [(p.expected, p.filtered, p.force, p.system.by_run, p.residual, p.theta, p.readings) for p in parts]
    expected, filtered, force, system, residual, theta, readings = joined(own, len(start))
    products = jax.device_put(sum(np.asarray(p.products) for p in parts))
    log_determinant = jax.device_put(sum(np.asarray(p.log_determinant) for p in parts))
    system = System(*system, start_std)
    return FilteredRuns(expected, filtered, force, system, residual, theta, readings, products, log_determinant)


def _filtered_share(
    vehicle: AbstractVehicle,
    runs: Runs,
    sigma: Array,
    disturbance: Disturbance,
    start: Array,
    begin: Values,
    start_std: Array,
) -> FilteredRuns:
    """`filter_runs` of a share of the runs, at once."""
    readings = readings_of(vehicle, runs)
    prompt, moved = as_if_prompt(vehicle, runs, readings)
    expected, filtered, force, push = _path(prompt, moved, sigma, disturbance, start, begin)
    by = jacobians(vehicle, runs, filtered, expected, push)
    readings = jax.device_put(readings)
    own = vehicle.turning, runs, moved.mask, sigma, start_std, readings
    system, residual, theta, whole = _columns(*own, expected, filtered, push, by)
    # waited for, so that no more shares than cores are in memory
    products, log_determinant = jax.block_until_ready(total_products(disturbance, system, whole))
    return FilteredRuns(expected, filtered, force, system, residual, theta, readings, products, log_determinant)


@compiled
def _columns(
    turning: tuple[bool, ...],
    runs: Runs,
    measured: Array,
    sigma: Array,
    start_std: Array,
    readings: Array,
    expected: Array,
    filtered: Array,
    push: Array,
    by: Jacobians,
) -> tuple[System, Columns, Columns, Columns]:
    """The system along a path, the columns of the residual and of the free parameters, and both, padded.

    `measured` (R, K, c) is whether the reading that shows a sample was.
    """
    error = by_readings(wrapped(turning, runs.outputs - by.shown), readings)
    by = dataclasses.replace(by, C=by_readings(by.C, readings), direct=by_readings(by.direct, readings))
    runs = dataclasses.replace(runs, mask=measured)
    # the path was led by its corrections and by the force; a free path from the expected state would not have been
    led = jnp.einsum("rkst,rkt->rks", by.A, (filtered - expected)[:, :-1])
    led += jnp.einsum("rksn,rkn->rks", by.G, push.reshape(*push.shape[:2], -1))
    residual = Columns(jnp.where(runs.mask, error / sigma, 0.0)[..., None], led[..., None])
    theta = Columns(jnp.where(runs.mask[..., None], by.direct / sigma[:, None], 0.0), by.F)
    whole = residual + theta
    whole = whole.padded(padded_width(whole.shown.shape[-1]))
    return System.of(by, runs, sigma, start_std), residual, theta, whole


@compiled
def _path(
    vehicle: AbstractVehicle, runs: Runs, sigma: Array, disturbance: Disturbance, start: Array, begin: Values
) -> tuple[Float[Array, "r k s"], Float[Array, "r k s"], Float[Array, "r k n"], Float[Array, "r k1 2 n"]]:
    """Expected and filtered states, filtered forces, and the force at both ends of each interval."""
    sampled = Sampled.of(vehicle, runs)
    nodes = jax.vmap(vehicle.actuate)(runs.times, runs.nodes())
    s, n = start.shape[1], len(disturbance.force)
    noise = (sigma * disturbance.noise) ** 2

    def correct(m: Array, P: Array, seen: tuple[Array, ...]) -> tuple[Array, Array]:
        time, signals, outputs, mask = seen
        show = lambda x: vehicle.measure(time, x, signals)
        C = jnp.where(mask[:, None], jax.jacfwd(show)(m[:s]), 0.0)
        error = jnp.where(mask, vehicle.deviation(outputs, show(m[:s])), 0.0)
        across = C @ P[:s]
        S = across[:, :s] @ C.T + jnp.diag(jnp.where(mask, noise, 1.0))
        gain = cho_solve((jnp.linalg.cholesky(S), True), across).T
        return m + gain @ error, P - gain @ across

    def predict(m: Array, P: Array, node: Array, index: Array, live: Array) -> tuple[Array, Array]:
        interval = runs.steps[index]
        d, later = m[s:], jnp.exp(-interval / disturbance.time) * m[s:]

        def step(z: Array) -> Array:
            x, begin, end = jnp.split(z, [s, s + n])
            return sampled.step(x, node, index, jnp.stack([begin, end]))

        moved, push = jax.linearize(step, jnp.concatenate([m[:s], d, later]))
        A, G = jnp.split(jax.vmap(push, out_axes=-1)(jnp.eye(s + 2 * n, dtype=m.dtype)), [s], axis=1)
        F, B = augmented(disturbance, A, G, interval)
        after = jnp.concatenate([moved, later]), F @ P @ F.T + B @ B.T
        return jax.tree.map(lambda new, old: jnp.where(live, new, old), after, (m, P))

    def advance(carry: tuple[Array, Array], sample: tuple) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        seen, moving = sample
        m, P = correct(*carry, seen)
        return predict(m, P, *moving), (carry[0], m)

    def run(start: Array, begin: Array, *samples: Array) -> tuple[Array, Array]:
        seen, moving = samples[:4], samples[4:]
        # an interval after the last sample, so that one loop serves all; it leads nowhere
        moving = tuple(jnp.concatenate([a, a[-1:]]) for a in moving)
        m = jnp.concatenate([start, jnp.zeros(n)])
        P = block_diag(begin, jnp.diag(disturbance.force**2))
        return jax.lax.scan(advance, (m, P), (seen, moving))[1]

    seen = (runs.times, runs.signals, runs.outputs, runs.mask)
    expected, filtered = jax.vmap(run)(start, jnp.asarray(begin), *seen, nodes, runs.step_of, runs.live)
    force = filtered[..., s:]
    push = forces_at_ends(force, runs.steps[runs.step_of], disturbance.time)
    return expected[..., :s], filtered[..., :s], force, jnp.asarray(push)


def forces_at_ends(
    force: Float[Values, "r k n"], steps: Float[Values, "r k1"], time: Float[Values, " n"]
) -> Float[Values, "r k1 2 n"]:
    """A filtered force (N, N m) at both ends of each interval of `steps` s, over which it fades by its `time` in s."""
    xp = namespace(force, steps)
    kept = xp.exp(-steps[..., None] / time) * force[:, :-1]
    return xp.stack([force[:, :-1], kept], axis=2)
