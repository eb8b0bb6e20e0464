r"""The disturbance that a fit's residuals show, of runs however long.

Long runs are seen twice: windows of samples show what is fast, and the means of groups of samples what is slow, over
whole runs. Windows alone are not enough. Their initial states are free and take up a small force, which integrates over
the whole run: for white residuals of 24 000 samples it made standard errors up to ten times too large.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..arrays import Values
from ..estimate import Problem, estimate_disturbance_at_once
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
    response,
)
from ..likelihood.blocks import Watch, is_short
from ..programs import compiled
from ..recording.runs import Runs

# samples that the disturbance of long runs is estimated from: its few numbers gain nothing from more; and of what a
# filter carries along them, states and forces times columns, which its gradient keeps several times: 0.2 GB in all
_WINDOWS, _LENGTH, _CARRIED = 8, 2500, 3_000_000


class Noise(NamedTuple):
    """Standard deviations (c,) of the channels' noise and (s,) of the initial states before the data, SI."""

    sigma: Float[Array, " c"]
    start_std: Float[Array, " s"]

    @classmethod
    def of(cls, problem: Problem) -> "Noise":
        """Of a problem; whatever its vehicle is, programs that take these serve it."""
        return cls(problem.sigma, problem.start_std)


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
    averages = () if whole else (_averages(Noise.of(problem), model, directions, watch),)
    return _estimated(Noise.of(problem), runs, linearised, directions, *averages)


@compiled
def _estimated(noise: Noise, runs: Runs, model: Linearised, directions: Directions, *averages: Averages) -> Disturbance:
    system, shown = _residual_and_columns(noise, runs, model, directions)
    guess = lambda system, shown: first_guess([response(system, jnp.asarray(shown)[..., 0])], system.C.shape[2])
    start = guess(system, shown)
    for part in averages:
        slow = guess(part.system, part.columns.shown)
        # of whole runs: midway between one sample, not one group, and the run
        start = Disturbance(slow.force, slow.time * jnp.sqrt(part.interval / part.duration), start.noise)
    return estimate_disturbance_at_once(system, Columns(shown), directions.prior, start, *averages)


def _windows(model: BlockLinearised) -> tuple[Runs, Linearised]:
    """All of short runs, else windows of `_LENGTH` samples, evenly spread."""
    count, samples = model.runs.times.shape
    if is_short(model.runs):
        runs, parts = zip(*(model.share(number) for number in range(len(model.shares))), strict=True)
        # with what fills the last share up, which counts for nothing
        return _beside(runs), jax.tree.map(_end_to_end, *parts)
    length, layout = min(samples, _LENGTH), model.vehicle.layout
    carried = (len(layout.states) + len(layout.equations)) * padded_width(1 + len(layout.free))
    windows = min(_WINDOWS, max(1, _CARRIED // (length * carried)))
    chosen = _spread(count, windows)
    begins = _spread(samples - length + 1, max(1, windows // len(chosen)))
    every = itertools.product(begins.tolist(), chosen.tolist())
    runs, parts = zip(*(model.window(run, begin, length) for begin, run in every), strict=True)
    return _beside(runs), jax.tree.map(_end_to_end, *parts)


def _end_to_end(*parts: Values) -> Values:
    return parts[0] if len(parts) == 1 else jax.device_put(np.concatenate(parts))


def _beside(parts: Sequence[Runs]) -> Runs:
    """The runs of all `parts` as one batch."""
    arrays = ("times", "step_of", "live", "signals", "outputs", "mask")
    return dataclasses.replace(
        parts[0], **{name: _end_to_end(*(getattr(part, name) for part in parts)) for name in arrays}
    )


def _averages(noise: Noise, model: BlockLinearised, directions: Directions, watch: Watch) -> Averages:
    """Means over groups of samples, about as many as a window has samples, at least one in a block."""
    chosen = _spread(len(model.runs.times), max(1, _LENGTH // model.blocks))
    groups = max(1, _LENGTH // (model.blocks * len(chosen)))
    means = [[] for _ in range(model.blocks)]
    for number, some in enumerate(model.shares):
        inside = [run - some.start for run in chosen.tolist() if some.start <= run < some.stop]
        for index in range(model.blocks) if inside else ():
            runs, linearised = model.block(number, index)
            for run in inside:
                own = jax.tree.map(lambda leaf, run=run: np.asarray(leaf)[run : run + 1], linearised)
                means[index].append(jax.device_get(_means(noise, runs.take([run], 1), own, directions, groups)))
            watch((number + (index + 1) / model.blocks) / len(model.shares))
    beside = lambda *arrays: np.concatenate(arrays) if np.ndim(arrays[0]) > 1 else arrays[0]
    joined = [jax.tree.map(beside, *own) for own in means]
    return Averages.joined(joined, int(model.runs.live[chosen].sum()))


@compiled
def _means(
    noise: Noise, runs: Runs, model: Linearised, directions: Directions, groups: int
) -> tuple[System, Float[Array, "r j1 c q"]]:
    return group_means(*_residual_and_columns(noise, runs, model, directions), groups)


def _residual_and_columns(
    noise: Noise, runs: Runs, model: Linearised, directions: Directions
) -> tuple[System, Float[Array, "r k c q"]]:
    """The linearised system, and the residual beside the columns along the `basis`."""
    theta, _, residual = whitened_columns(noise, runs, model)
    theta = jnp.where(directions.held, 0.0, theta) @ directions.basis
    system = System.of(model, runs, noise.sigma, noise.start_std)
    return system, jnp.concatenate([residual[..., None], theta], axis=-1)


def _spread(count: int, most: int) -> Int[np.ndarray, " m"]:
    """At most so many of the numbers below `count`, evenly spread."""
    return np.linspace(0, count - 1, min(count, most)).round().astype(int)


def whitened_columns(noise: Noise, runs: Runs, model: Linearised) -> tuple[Array, Array, Array]:
    """Whitened sensitivities to the coefficients (physical) and to the initial states (in their spreads); residuals."""
    weight = runs.mask / noise.sigma
    theta = model.theta * weight[..., None]
    return theta, model.start * weight[..., None] * noise.start_std, model.error / noise.sigma
