r"""Output-error likelihood: measured outputs against those of an open-loop simulation.

$-\ln p(Z\mid\theta, x_0) = \tfrac12\sum_{r,k,c} m_{rkc}\,(z_{rkc} - \hat y_{rkc}(\theta, x_{0r}))^2/\sigma_c^2
+ \sum_c N_c\ln\sigma_c$, with m the mask, one free initial state a run, and $\sigma$ given or concentrated out.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import simulate
from ..vehicle import AbstractVehicle
from ..vehicle.base import wrapped

_TURN = 2.0 * jnp.pi


def errors(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Float[Array, "r k c"]:
    """Measured minus modelled outputs of `vehicle` over `runs`, (R, K, c) in SI, zero where nothing was measured.

    `start` (R, s) are the initial states, SI.
    """
    return residual_outputs(vehicle, runs, simulate(vehicle, runs, start))


def residual_outputs(
    vehicle: AbstractVehicle,
    runs: Runs,
    modelled: Float[Array, "r k c"],
    turns: Float[Array, "r c"] | None = None,
) -> Float[Array, "r k c"]:
    """`wrapped_errors` of outputs `modelled` (R, K, c), SI, of `vehicle` over `runs`; `turns` (R, c) are as there."""
    return wrapped_errors(vehicle.turning, runs, modelled, turns)


@compiled
def wrapped_errors(
    turning: tuple[bool, ...],
    runs: Runs,
    modelled: Float[Array, "r k c"],
    turns: Float[Array, "r c"] | None = None,
) -> Float[Array, "r k c"]:
    """Measured minus `modelled`, zero where nothing was measured.

    Channels that are `turning` are angles, wrapped to (-π, π]. Where their turns are counted only the first sample's
    is: a model that turns once too often is a turn off, and not right again, so that a search that begins far off finds
    the way back. `turns` are those of `first_turns` where that sample lies before `runs`, which are then blocks of
    longer ones.
    """
    error = wrapped(turning, runs.outputs - modelled)
    if any(runs.counted):
        whole = runs.outputs - modelled
        first = first_turns(runs, modelled, turns)
        whole = whole - _TURN * jnp.where(jnp.isnan(first), 0.0, first)[:, None]
        error = jnp.where(jnp.array(runs.counted), whole, error)
    return jnp.where(runs.mask, error, 0.0)


def first_turns(
    runs: Runs, modelled: Float[Array, "r k c"], before: Float[Array, "r c"] | None = None
) -> Float[Array, "r c"]:
    """Whole turns by which each run's first measured sample differs from `modelled`, NaN where none is measured.

    Those `before` `runs`, where they are known, stay.
    """
    whole = runs.outputs - modelled
    first = jnp.take_along_axis(whole, jnp.argmax(runs.mask, axis=1)[:, None], axis=1)[:, 0]
    own = jnp.where(jnp.any(runs.mask, axis=1), jax.lax.stop_gradient(jnp.round(first / _TURN)), jnp.nan)
    return own if before is None else jnp.where(jnp.isnan(before), own, before)


def concentrated_sigma(error: Float[Array, "r k c"], runs: Runs) -> Float[Array, " c"]:
    """The standard deviation (c,) of each channel that maximises the likelihood of `error` over `runs`: the rms."""
    return jnp.sqrt(jnp.sum(error**2, (0, 1)) / jnp.maximum(runs.samples(), 1.0))


def negative_log_likelihood(
    vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"], sigma: Float[Array, " c"] | None = None
) -> Float[Array, ""]:
    """-ln p of the outputs of `runs` under `vehicle`, up to a constant.

    `start` (R, s) are the initial states, SI; `sigma` (c,), SI, is concentrated out where it is None.
    """
    error = errors(vehicle, runs, start)
    scale = concentrated_sigma(error, runs) if sigma is None else sigma
    return 0.5 * jnp.sum((error / scale) ** 2) + jnp.sum(runs.samples() * jnp.log(scale))
