r"""The disturbance that a fit's residuals show, of runs however long.

Long runs are seen twice: windows of samples show what is fast, and the means of groups of samples what is slow, over
whole runs. Windows alone are not enough. Their initial states are free and take up a small force, which integrates over
the whole run: for white residuals of 24 000 samples it made standard errors up to ten times too large.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..estimate import Problem, estimate_disturbance
from ..likelihood import (
    Averages,
    BlockLinearised,
    Columns,
    Disturbance,
    Linearised,
    System,
    first_guess,
    group_means,
    padded_width,
)
from ..likelihood.blocks import Watch
from ..programs import compiled
from ..recording.runs import Runs

# samples that the disturbance of long runs is estimated from: its few numbers gain nothing from more; and of what a
# filter carries along them, states and forces times columns, which its gradient keeps several times: 0.2 GB in all
_WINDOWS, _LENGTH, _CARRIED = 8, 2500, 3_000_000


class Directions(eqx.Module):
    """Which combinations of coefficients are fitted to residuals.

    **Fields**

    - `held`: (p,) coefficients at a bound. `basis`: (p, p) the directions of the others, in its columns.
    - `prior`: (p+1, p+1) products of the priors of the residual and of the columns along the `basis`.
    """

    held: Bool[Array, " p"]
    basis: Float[Array, "p p"]
    prior: Float[Array, "p1 p1"]


def residual_disturbance(problem: Problem, model: BlockLinearised, directions: Directions, watch: Watch) -> Disturbance:
    """The disturbance of the residuals of `model`. `watch` is called with the share that is done."""
    runs, linearised = _windows(model)
    whole = runs.times.shape[1] == model.runs.times.shape[1]
    averages = () if whole else (_averages(problem, model, directions, watch),)
    return _estimated(problem, runs, linearised, directions, *averages)


@compiled
def _estimated(
    problem: Problem, runs: Runs, model: Linearised, directions: Directions, *averages: Averages
) -> Disturbance:
    system, shown = _residual_and_columns(problem, runs, model, directions)
    start = first_guess(system, shown[..., 0])
    for part in averages:
        slow = first_guess(part.system, jnp.asarray(part.columns.shown[..., 0]))
        # of whole runs: midway between one sample, not one group, and the run
        start = Disturbance(slow.force, slow.time * jnp.sqrt(part.interval / part.duration), start.noise)
    return estimate_disturbance(system, Columns(shown), directions.prior, start, *averages)


def _windows(model: BlockLinearised) -> tuple[Runs, Linearised]:
    """All of it where that is one block, else windows of `_LENGTH` samples from where blocks begin."""
    if model.only is not None:
        return model.runs, model.only
    count, samples = model.runs.times.shape
    length, layout = min(samples, _LENGTH), model.vehicle.layout
    carried = (len(layout.states) + len(layout.equations)) * padded_width(1 + len(layout.free))
    windows = min(_WINDOWS, max(1, _CARRIED // (length * carried)))
    chosen = _spread(count, windows)
    latest = (samples - length) // model.length
    firsts = _spread(latest + 1, max(1, windows // len(chosen)))
    parts = [model.window(first, chosen, length) for first in firsts.tolist()]
    arrays = ("times", "step_of", "live", "signals", "outputs", "mask")
    whole = lambda *pieces: jnp.asarray(np.concatenate(pieces))
    runs = dataclasses.replace(
        parts[0][0], **{name: whole(*(getattr(part, name) for part, _ in parts)) for name in arrays}
    )
    return runs, jax.tree.map(whole, *(linearised for _, linearised in parts))


def _averages(problem: Problem, model: BlockLinearised, directions: Directions, watch: Watch) -> Averages:
    """Means over groups of samples, about as many as a window has samples, at least one in a block."""
    count = len(model)
    chosen = _spread(len(model.runs.times), max(1, _LENGTH // count))
    groups = max(1, _LENGTH // (count * len(chosen)))
    means = []
    for index in range(count):
        runs, linearised = model[index]
        linearised = jax.tree.map(lambda leaf: leaf[chosen], linearised)
        found = _means(problem, runs.take(chosen.tolist(), len(chosen)), linearised, directions, groups)
        means.append(jax.device_get(found))
        watch((index + 1) / count)
    return Averages.joined(means, int(model.runs.live[chosen].sum()))


@compiled
def _means(
    problem: Problem, runs: Runs, model: Linearised, directions: Directions, groups: int
) -> tuple[System, Float[Array, "r j1 c q"]]:
    return group_means(*_residual_and_columns(problem, runs, model, directions), groups)


def _residual_and_columns(
    problem: Problem, runs: Runs, model: Linearised, directions: Directions
) -> tuple[System, Float[Array, "r k c q"]]:
    """The linearised system, and the residual beside the columns along the `basis`."""
    theta, _, residual = whitened_columns(problem, runs, model)
    theta = jnp.where(directions.held, 0.0, theta) @ directions.basis
    system = System.of(model, runs, problem.sigma, problem.start_std)
    return system, jnp.concatenate([residual[..., None], theta], axis=-1)


def _spread(count: int, most: int) -> Int[np.ndarray, " m"]:
    """At most so many of the numbers below `count`, evenly spread."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(int)


def whitened_columns(problem: Problem, runs: Runs, model: Linearised) -> tuple[Array, Array, Array]:
    """Whitened sensitivities to the coefficients (physical) and to the initial states (in their spreads); residuals."""
    weight = runs.mask / problem.sigma
    theta = model.theta * weight[..., None]
    return theta, model.start * weight[..., None] * problem.start_std, model.error / problem.sigma
