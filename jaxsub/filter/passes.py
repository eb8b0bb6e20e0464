"""Filters off-line: the on-line step scanned over runs, once or several times."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..programs import compiled
from .ekf import AbstractFilter, Estimate, FilterState
from .model import Sample


def over_runs(
    filter: AbstractFilter, state: FilterState, samples: Sample, starts: Float[Array, "r n"]
) -> tuple[FilterState, Estimate]:
    """The state of `filter` after R runs of K `samples` and the estimates after each, (R, K) of them.

    It begins with `state`. Every run starts from its own state of `starts`, (R, n), SI; the parameters and their
    covariance go from one run to the next.
    """

    def run(state: FilterState, part: tuple[Array, Sample]) -> tuple[FilterState, Estimate]:
        start, sequence = part
        following = lambda state, sample: filter.step(state, sample)
        return jax.lax.scan(following, filter.restart(state, start), sequence)

    return jax.lax.scan(run, state, (starts, samples))


class Identified(eqx.Module):
    """Parameters from a filter, of R runs of K samples.

    **Fields**

    - `theta`: (p,) parameters after the last pass, in their coordinates.
    - `covariance`: (p, p) of the coordinates, of that pass alone.
    - `trace`: (passes, p) the coordinates after each pass.
    - `diverged`: whether the last pass did; then `theta` is where it broke down.
    """

    theta: Float[Array, " p"]
    covariance: Float[Array, "p p"]
    trace: Float[Array, "passes p"]
    diverged: Bool[Array, ""]


@compiled
def identify(
    filter: AbstractFilter,
    samples: Sample,
    starts: Float[Array, "r n"],
    theta: Float[Array, " p"],
    theta_root: Float[Array, "p p"] | None = None,
    passes: int = 1,
) -> Identified:
    """Parameters from `passes` of `filter` over the same runs; each starts from its own state of `starts`, (R, n), SI.

    `samples` are (R, K) of them. Each pass takes its parameters from the one before, the first `theta` (p,), and its
    uncertainty from `theta_root` again: data that were counted once are not counted twice. `theta_root` is a square
    root of the covariance of `theta`, by default one: in a `Transform`'s coordinates each parameter's own size, which
    holds back neither its sign nor its double.
    """
    root = jnp.eye(theta.size, dtype=theta.dtype) if theta_root is None else theta_root

    def once(theta: Array, _: None) -> tuple[Array, tuple[Array, Array, Array]]:
        state, _estimates = over_runs(filter, filter.start(starts[0], theta, root), samples, starts)
        s = len(filter.x_root)
        return state.theta, (state.theta, filter.form.covariance(state.joint)[s:, s:], state.diverged)

    theta, (trace, covariance, diverged) = jax.lax.scan(once, theta, None, length=passes)
    return Identified(theta, covariance[-1], trace, diverged[-1])
