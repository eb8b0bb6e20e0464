"""What every estimator is to the rest of the house, and those that step from point to point."""

import abc
import dataclasses
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from ..results import RESULTS
from .pool import pool
from .problem import Problem

# a search's working set is this many copies of its whitened Jacobian; lanes share what memory there is
_COPIES, _MEMORY, _LANES = 6, 1.0e9, 8


class Found(eqx.Module):
    """Where N searches ended.

    **Fields**

    - `y`: (N, d) coordinates. `cost`: (N,) ½ Σ residuals² there.
    - `evaluations`: (N,) of the cost, with whichever derivatives the method takes along.
    - `result`: a `RESULTS` value each.
    """

    y: Float[Array, "*n d"]
    cost: Float[Array, "*n"]
    evaluations: Int[Array, "*n"]
    result: RESULTS

    def one(self, index: int) -> "Found":
        """Where the search numbered `index` ended."""
        return jax.tree.map(lambda leaf: leaf[index], self)


class AbstractMethod(eqx.Module):
    """An estimator: from starts in a problem's coordinates to where it ends. Failures are values."""

    @abc.abstractmethod
    def run(
        self, problem: Problem, starts: Float[Array, "n d"], outputs: Float[Array, "n r k c"] | None = None
    ) -> Found:
        """Estimate from each of the `starts`; `outputs`, if given, are recordings of their own for each."""


def objective(y: Float[Array, " d"], problem: Problem) -> Float[Array, ""]:
    r"""The paper's $J = \frac{1}{M+1}\sum_k (z_k - Cx_k)^TR^{-1}(z_k - Cx_k)$ over the M + 1 samples of all runs."""
    return 2.0 * problem.cost(y) / (jnp.sum(problem.runs.live) + len(problem.runs.times))


class Iterative(AbstractMethod):
    """A minimiser of optimistix's kind that steps until it is done, or has taken `max_steps`."""

    solver: optx.AbstractMinimiser
    max_steps: int = eqx.field(static=True)

    def run(
        self, problem: Problem, starts: Float[Array, "n d"], outputs: Float[Array, "n r k c"] | None = None
    ) -> Found:
        """All starts through pools of lanes. Not to be called in `jit`."""
        return over_cores(lambda y, z: _pooled(self, problem, y, z, lanes_for(problem)), problem, starts, outputs)


def over_cores(
    run: Callable[[Array, Array | None], Found], problem: Problem, starts: Array, outputs: Array | None
) -> Found:
    """`run(starts, outputs)` in equal shares, one a core, where there are starts enough to be worth it."""
    cores = os.cpu_count() or 1
    if len(starts) < 4 * lanes_for(problem) * cores:
        return run(starts, outputs)
    # the last share is filled up with copies, so that one compiled program serves all
    share = -(-len(starts) // cores)
    index = np.minimum(np.arange(share * cores), len(starts) - 1).reshape(cores, share)
    own = lambda chosen: run(starts[chosen], None if outputs is None else outputs[chosen])
    with ThreadPoolExecutor(cores) as threads:
        parts = list(threads.map(lambda chosen: jax.block_until_ready(own(chosen)), index))
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[: len(starts)], *parts)


@eqx.filter_jit
def _pooled(method: Iterative, problem: Problem, starts: Array, outputs: Array | None, lanes: int) -> Found:
    of = problems(problem, outputs)
    ends = pool(method.solver, objective, starts, of, lanes=lanes, max_steps=method.max_steps)
    # without a value at the very start there is nothing that a search could have done
    never = (ends.steps == 1) & (ends.result == RESULTS.promote(optx.RESULTS.nonfinite))
    result = jax.vmap(lambda never, result: RESULTS.where(never, RESULTS.nan_start, result))(never, ends.result)
    return Found(ends.y, costs(of, ends.y, lanes), ends.steps, result)


def problems(problem: Problem, outputs: Array | None) -> Callable[[Int[Array, ""]], Problem]:
    """The problem that each start is for: its own recording, where there are `outputs`."""
    if outputs is None:
        return lambda index: problem
    return lambda index: eqx.tree_at(lambda problem: problem.runs.outputs, problem, outputs[index])


def holding(
    of: Callable[[Int[Array, ""]], Problem], y: Float[Array, "n d"], moving: Bool[Array, "n p"]
) -> Callable[[Int[Array, ""]], Problem]:
    """The problem that each start is for, with the parameters that are not `moving` held at those of `y`."""
    p = moving.shape[1]
    return lambda index: dataclasses.replace(of(index), origin=y[index, :p], moving=moving[index])


def costs(of: Callable[[Any], Problem], y: Float[Array, "n d"], lanes: int) -> Float[Array, " n"]:
    """The cost at each of `y`, `lanes` at a time."""
    return jax.lax.map(lambda at: of(at[0]).cost(at[1]), (jnp.arange(len(y)), y), batch_size=lanes)


def lanes_for(problem: Problem) -> int:
    """How many searches may share the memory at once."""
    columns = len(problem.prior_mean) + len(problem.spread) + 1
    return int(max(1, min(_LANES, _MEMORY / (8 * _COPIES * problem.runs.outputs.size * columns))))
