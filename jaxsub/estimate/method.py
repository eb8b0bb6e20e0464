"""What every estimator is to the rest of the house, and those that step from point to point."""

import abc
import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax.sharding import Mesh, PartitionSpec
from jaxtyping import Array, Bool, Float, Int

from ..programs import compiled, cores, on_cores
from ..results import NONFINITE, RESULTS
from .pool import pool
from .problem import Problem

# a search's working set is this many copies of its whitened Jacobian; lanes share what memory there is
_COPIES = 6
# bytes and lanes of a pool on a core; and on an accelerator, which has one pool and this part of its memory. There a
# step of 256 searches takes little longer than one of 16 (2.5 times on an H200), and wider pools wait for their slowest
_MEMORY, _LANES = 1.0e9, 8
_PART_OF_ACCELERATOR, _LANES_OF_ACCELERATOR = 0.5, 256
# searches that a lane takes one after the other: enough that little time goes by with lanes idle at the end of a share
_TURNS = 16


# called with the passes over all samples that are done, and how many are expected
Passes = Callable[[float, float], object]


def unwatched(done: float, expected: float) -> None:
    """Does nothing: progress that nobody watches."""


@runtime_checkable
class Costed(Protocol):
    """What has a `cost`."""

    @property
    def cost(self) -> Any:
        """Minus a log likelihood."""


C = TypeVar("C", bound=Costed)


def by_cost(found: Iterable[C]) -> list[C]:
    """`found` in order of `cost`, the least first, and what has no finite one last."""
    return sorted(found, key=lambda one: float(one.cost) if np.isfinite(float(one.cost)) else np.inf)


class Found(eqx.Module):
    """Where N searches ended.

    **Fields**

    - `y`: (N, d) coordinates. `cost`: (N,) ½ Σ whitened residuals² there.
    - `evaluations`: (N,) how many of the cost, with whichever derivatives the method takes along.
    - `result`: a `RESULTS` value each.
    """

    y: Float[Array, "*n d"]
    cost: Float[Array, "*n"]
    evaluations: Int[Array, "*n"]
    result: RESULTS

    def one(self, index: int) -> "Found":
        """Where the search numbered `index` ended."""
        # by NumPy, for which no program has to be made
        return jax.tree.map(lambda leaf: jax.device_put(np.asarray(leaf)[index]), self)


class AbstractMethod(eqx.Module):
    """An estimator: from starts in a problem's coordinates to where it ends. Failures are values."""

    @abc.abstractmethod
    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """Estimate from each of the `starts` (n, d), coordinates of `problem`.

        `outputs` (n, R, K, c), SI, if given, are recordings of their own for each. A method that takes long runs block
        by block calls `passes` with the passes over all samples that it has made, and those that it expects to make.
        """


def objective(y: Float[Array, " d"], problem: Problem) -> Float[Array, ""]:
    r"""The paper's $J = \frac{1}{M+1}\sum_k (z_k - Cx_k)^TR^{-1}(z_k - Cx_k)$ over the M + 1 samples of all runs."""
    return 2.0 * problem.cost(y) / (jnp.sum(problem.runs.live) + len(problem.runs.times))


class Iterative(AbstractMethod):
    """A minimiser of optimistix's kind that steps until it is done, or has taken `max_steps`."""

    solver: optx.AbstractMinimiser
    max_steps: int = eqx.field(static=True)

    def run(
        self,
        problem: Problem,
        starts: Float[Array, "n d"],
        outputs: Float[Array, "n r k c"] | None = None,
        passes: Passes | None = None,
    ) -> Found:
        """All starts through pools of lanes. Not to be called in `jit`."""
        return in_shares(pooled, self, problem, starts, outputs)


T = TypeVar("T")
Program = Callable[[Any, Problem, Array, Array | None], T]


def in_shares(program: Program[T], method: Any, problem: Problem, starts: Array, outputs: Array | None) -> T:
    """`program(method, problem, starts, outputs)` in shares of one size, over all devices or a CPU's cores.

    Where a share begins depends on neither, so the same start meets the same program with the same neighbours and ends
    at the same number to the last digit on any number of CPUs. The last share is filled with starts that end at once.
    """
    count, size = len(starts), share_for(problem)
    if count <= size:
        return program(method, problem, starts, outputs)
    devices = jax.local_devices()
    shares = -(-count // (size * len(devices))) * len(devices)
    fill = lambda a: jnp.concatenate([a, jnp.full((shares * size - count, *a.shape[1:]), jnp.nan, a.dtype)])
    cut = lambda a: fill(a).reshape(-1, len(devices) * size, *a.shape[1:])
    rounds = zip(cut(starts), [None] * shares if outputs is None else cut(outputs), strict=False)
    if len(devices) > 1:
        parts = [_over_devices(program, method, problem, y, z) for y, z in rounds]
    else:
        rounds = list(rounds)
        ready = program.lower(method, problem, *rounds[0]).compile()
        own = lambda *part: jax.block_until_ready(ready(method, problem, *part))
        parts = on_cores(own, rounds, shares_at_once(), ready=True)
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[:count], *parts)


@compiled
def _over_devices(program: Callable, method: Any, problem: Problem, starts: Array, outputs: Array | None) -> Any:
    """One share on each local device; none waits for another before the end."""
    mesh, each, same = Mesh(np.array(jax.local_devices()), ("share",)), PartitionSpec("share"), PartitionSpec()
    numbers, rest = eqx.partition((method, problem), eqx.is_array)
    own = lambda numbers, starts, outputs: program(*eqx.combine(numbers, rest), starts, outputs)
    shared = jax.shard_map(own, mesh=mesh, in_specs=(same, each, each), out_specs=each, check_vma=False)
    return shared(numbers, starts, outputs)


@compiled
def pooled(method: Iterative, problem: Problem, starts: Array, outputs: Array | None) -> Found:
    """A search from each of the starts, `lanes_for` at a time."""
    of, lanes = problems(problem, outputs), lanes_for(problem)
    ends = pool(method.solver, objective, starts, of, lanes=lanes, max_steps=method.max_steps)
    return Found(ends.y, costs(of, ends.y, lanes), ends.steps, jax.vmap(from_start)(ends.result, ends.steps))


def from_start(result: RESULTS, steps: Int[Array, ""]) -> RESULTS:
    """`result`, which says so where there was no value at the very start and so nothing that a search could do."""
    never = (steps == 1) & (result == NONFINITE)
    return RESULTS.where(never, RESULTS.nan_start, result)


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
    memory, lanes = _room()
    return int(max(1, min(lanes, memory / bytes_of_a_lane(problem))))


def bytes_of_a_lane(problem: Problem) -> int:
    """What one search takes at once: its whitened Jacobian, some copies of it."""
    columns = len(problem.prior_mean) + len(problem.start_std) + 1
    return 8 * _COPIES * problem.runs.outputs.size * columns


def share_for(problem: Problem) -> int:
    """How many starts go through one pool, each with a recording of its own, which the memory has to hold too."""
    return int(max(1, min(_TURNS * lanes_for(problem), _room()[0] / (8 * problem.runs.outputs.size))))


def shares_at_once() -> int:
    """How many shares are worked on side by side: one on each device, and on a single CPU one on each core."""
    devices = jax.local_device_count()
    return cores() if devices == 1 and jax.default_backend() == "cpu" else devices


def _room() -> tuple[float, int]:
    """Bytes and lanes that a pool may have, on the device that JAX picks."""
    stats = None if jax.default_backend() == "cpu" else jax.local_devices()[0].memory_stats()
    return (_PART_OF_ACCELERATOR * stats["bytes_limit"], _LANES_OF_ACCELERATOR) if stats else (_MEMORY, _LANES)
