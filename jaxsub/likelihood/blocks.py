"""A model linearised along long runs one block of samples at a time, so that memory does not grow with their length.

Of many runs it is a share at a time, side by side on cores.

The first pass sums what sums are enough for, and leaves a checkpoint where each block begins; whatever is asked later,
in any order, is worked out again from there.
"""

from collections.abc import Callable, Iterator
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values
from ..effects import AbstractActuator, AbstractInstrument
from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import measure, sampled_states
from ..vehicle import AbstractVehicle
from .output_error import first_turns, wrapped_errors
from .run_shares import Progress, by_share, joined, share_of, shares
from .sensitivity import Checkpoint, Jacobians, Linearised, along, with_jacobians

# samples of all runs together up to which one block has all; and in a block of longer runs, where 500 to 8000 take as
# long, within 15 %, while memory grows by 0.1 MB a sample of a body in six degrees of freedom
_SHORT, _AT_ONCE = 20_000, 2_000

# called with the share of a pass over all samples that is done
Watch = Callable[[float], object]


def nobody(share: float) -> None:
    """Tell nobody."""


def is_short(runs: Runs) -> bool:
    """Whether the model linearised along all of `runs` takes little memory."""
    return runs.times.size <= _SHORT


def block_length(vehicle: AbstractVehicle, runs: Runs) -> int:
    """Intervals in a block of a share: all of them in short runs, and where actuators or sensors need those before."""
    count, samples = runs.times.shape
    whole = any(isinstance(effect, AbstractActuator | AbstractInstrument) for effect in vehicle.effects)
    return samples - 1 if whole or is_short(runs) else max(1, _AT_ONCE // count)


class BlockLinearised(eqx.Module):
    """A model linearised along R runs of K samples, in shares of the runs, and these in blocks of samples.

    A block of a share is linearised again whenever it is asked for, from the checkpoint where it begins; those of short
    runs are kept.

    **Fields**

    - `vehicle`, `runs`: the model and the runs. `sigma`: (c,) noise, SI. `start_std`: (s,) of the initial states, SI.
    - `products`: (R, q, q) of each run's whitened columns: by the p free parameters, by its initial state in its
      `start_std`, and the error.
    - `error`: (R, K, c) measured minus modelled, SI, zero where missing.
    - `begins`: the checkpoints of each share's blocks. `kept`: the linearised model of each share of short runs.
    - `length`: intervals in a block.
    """

    vehicle: AbstractVehicle
    runs: Runs
    sigma: Float[Array, " c"]
    start_std: Float[Array, " s"]
    products: Float[Array, "r q q"]
    error: Float[Array, "r k c"]
    begins: tuple[tuple[Checkpoint, ...], ...]
    kept: tuple[Linearised, ...]
    length: int = eqx.field(static=True)

    @classmethod
    def of(
        cls,
        vehicle: AbstractVehicle,
        runs: Runs,
        start: Float[Array, "r s"],
        sigma: Float[Array, " c"],
        start_std: Float[Array, " s"],
        watch: Watch = nobody,
    ) -> "BlockLinearised":
        """`vehicle` linearised along its trajectory over `runs` from the initial states `start` (R, s), SI.

        `sigma` (c,) is the noise of the channels and `start_std` (s,) the prior deviation of initial states, both SI.
        `watch` is called with the share of the samples that is done.
        """
        done = Progress(_shares(runs), watch)
        length, short = block_length(vehicle, runs.share(_shares(runs)[0])), is_short(runs)

        own = lambda some: (
            vehicle,
            runs.share(some),
            share_of(start, some),
            sigma,
            start_std,
            done.of(some),
            short,
        )
        found = by_share(_linearised_share, own, *runs.times.shape)
        begins, kept, products, errors = zip(*found, strict=True)
        products, error = joined([*zip(products, errors, strict=True)], len(start))
        return cls(vehicle, runs, sigma, start_std, products, error, begins, sum(kept, ()), length)

    @property
    def shares(self) -> list[slice]:
        """The runs of each share."""
        return _shares(self.runs)

    @property
    def blocks(self) -> int:
        """How many blocks each share has."""
        return len(self.begins[0])

    def block(self, number: int, index: int) -> tuple[Runs, Linearised]:
        """The runs of the block `index` of the share `number`, and the model linearised along them."""
        own = self.runs.share(self.shares[number])
        if self.kept:
            return own, self.kept[number]
        if self.blocks > 1:
            own = _cut(own, jnp.asarray(index * self.length), self.length)
        return own, _block(self.vehicle, own, self.begins[number][index], self.sigma, self.start_std)[0]

    def share(self, number: int) -> tuple[Runs, Linearised]:
        """The runs of the share `number`, and the model linearised along them, in memory that grows with these."""
        models = [self.block(number, index)[1] for index in range(self.blocks)]
        return self.runs.share(self.shares[number]), self._whole(models, self.runs.times.shape[1])

    def window(self, run: int, begin: int, samples: int) -> tuple[Runs, Linearised]:
        """`samples` samples of one `run`, from that numbered `begin` on, and the model linearised along them."""
        number, own = divmod(run, self.shares[0].stop)
        first, last = begin // self.length, -(-(begin + samples - 1) // self.length)
        models = [self.block(number, index)[1] for index in range(first, min(last, self.blocks))]
        # by NumPy: to cut arrays of JAX would be a program for each place
        models = [jax.tree.map(lambda leaf: np.asarray(leaf)[own : own + 1], model) for model in models]
        before = begin - first * self.length
        whole = self._whole(models, min(before + samples, self.runs.times.shape[1] - first * self.length))
        cut = lambda leaf: leaf[:, before:]
        runs = _cut(self.runs.take([run], 1), jnp.asarray(begin), samples - 1)
        return runs, jax.tree.map(cut, whole)

    def _whole(self, models: list[Linearised], samples: int) -> Linearised:
        return jax.tree.map(lambda *parts: _joined(list(parts), samples, self.length), *models)


def _shares(runs: Runs) -> list[slice]:
    return shares(*runs.times.shape)


def _linearised_share(
    vehicle: AbstractVehicle, runs: Runs, start: Array, sigma: Array, start_std: Array, watch: Watch, short: bool
) -> tuple[tuple[Checkpoint, ...], tuple[Linearised, ...], np.ndarray, Array]:
    """Of a share of the runs where blocks begin, the model where these are `short`, the products and the errors."""
    begins, errors, summed, kept = [], [], [], ()
    for at, model, products in _passed(vehicle, runs, start, sigma, start_std, watch):
        begins.append(at)
        summed.append(products)
        errors.append(model.error)
        kept = (model,) if short else ()
    error = _joined(errors, runs.times.shape[1], block_length(vehicle, runs))
    return tuple(begins), kept, np.sum(summed, axis=0), error


def summed_products(
    vehicle: AbstractVehicle,
    runs: Runs,
    start: Float[Array, "r s"],
    sigma: Float[Array, " c"],
    start_std: Float[Array, " s"],
    watch: Watch = nobody,
) -> Float[Array, "r q q"]:
    """The `products` of `BlockLinearised` alone."""
    done = Progress(_shares(runs), watch)

    own = lambda some: (vehicle, runs.share(some), share_of(start, some), sigma, start_std, done.of(some))
    return jnp.asarray(joined(by_share(_summed_share, own, *runs.times.shape), len(start)))


def _summed_share(*given: Any) -> np.ndarray:
    """The products of a share of the runs."""
    return np.sum([products for _, _, products in _passed(*given)], axis=0)


def _passed(
    vehicle: AbstractVehicle, runs: Runs, start: Array, sigma: Array, start_std: Array, watch: Watch
) -> Iterator[tuple[Checkpoint, Linearised, np.ndarray]]:
    """Where each block begins, the model linearised along it, and the products of its whitened columns."""
    at = Checkpoint.at_start(vehicle, start)
    for block in _blocks(runs, block_length(vehicle, runs), watch):
        model, products, after = _block(vehicle, block, at, sigma, start_std)
        yield at, model, np.asarray(products)
        at = after


def output_errors(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Float[Array, "r k c"]:
    """Measured minus modelled outputs of `vehicle` over `runs`, (R, K, c) in SI, zero where nothing was measured.

    `start` (R, s) are the initial states, SI. Long runs are taken in blocks. Not to be called in `jit`.
    """

    own = lambda some: (vehicle, runs.share(some), share_of(start, some))
    return joined(by_share(_share_errors, own, *runs.times.shape), len(start))


def _share_errors(vehicle: AbstractVehicle, runs: Runs, state: Array) -> Array:
    """The errors of a share of the runs from the initial `state`."""
    length, errors = block_length(vehicle, runs), []
    turns = jax.device_put(np.full((len(state), len(vehicle.layout.channels)), np.nan, state.dtype))
    for block in _blocks(runs, length, nobody):
        error, state, turns = _errors(vehicle, block, state, turns)
        errors.append(error)
    return _joined(errors, runs.times.shape[1], length)


def _block(
    vehicle: AbstractVehicle, runs: Runs, at: Checkpoint, sigma: Array, start_std: Array
) -> tuple[Linearised, Array, Checkpoint]:
    """The model linearised along a block, the products of its whitened columns, and where the next block begins."""
    return _summed(vehicle.turning, runs, at, *with_jacobians(vehicle, runs, at), sigma, start_std)


@compiled
def _summed(
    turning: tuple[bool, ...],
    runs: Runs,
    at: Checkpoint,
    states: Array,
    by: Jacobians,
    sigma: Array,
    start_std: Array,
) -> tuple[Linearised, Array, Checkpoint]:
    model, after = along(turning, runs, at, states, by)
    weight = (runs.mask / sigma)[..., None]
    columns = [model.theta * weight, model.start * weight * start_std, model.error[..., None] * weight]
    every = jnp.concatenate(columns, axis=-1)
    return model, jnp.einsum("rkca,rkcb->rab", every, every), after


def _errors(vehicle: AbstractVehicle, runs: Runs, state: Array, turns: Array) -> tuple[Array, Array, Array]:
    """The errors of a block that begins in `state`, and where the next one begins."""
    states = sampled_states(vehicle, runs, state)
    return _left(vehicle.turning, runs, states, measure(vehicle, runs, states), turns)


@compiled
def _left(
    turning: tuple[bool, ...], runs: Runs, states: Array, modelled: Array, turns: Array
) -> tuple[Array, Array, Array]:
    return wrapped_errors(turning, runs, modelled, turns), states[:, -1], first_turns(runs, modelled, turns)


def _blocks(runs: Runs, length: int, watch: Watch) -> Iterator[Runs]:
    """`runs` cut into blocks of `length` intervals, in order; themselves where they have no more."""
    last = runs.times.shape[1] - 1
    if length >= last:
        yield runs
        watch(1.0)
        return
    for begin in range(0, last, length):
        yield _cut(runs, jnp.asarray(begin), length)
        watch(min(1.0, (begin + length) / last))


_cut = compiled(Runs.block)


def _joined(parts: list[Values], samples: int, length: int) -> Array:
    """Blocks of samples, or of intervals, as one array; the sample that ends a block is that which begins the next."""
    ends = parts[0].shape[1] - length
    if len(parts) == 1:
        return jnp.asarray(parts[0][:, : samples - 1 + ends])
    whole = np.empty((len(parts[0]), samples - 1 + ends, *parts[0].shape[2:]), parts[0].dtype)
    for index, part in enumerate(parts):
        at = whole[:, index * length : (index + 1) * length + ends]
        at[...] = np.asarray(part)[:, : at.shape[1]]
    return jnp.asarray(whole)
