r"""Runs of a model in compiled C, many members of a batch side by side: the same equations without kernels to start.

The step, the outputs and their derivatives are those of the model itself, taken apart to numbers (`symbolic`), zeros
left out. Sensitivities follow $D_{k+1} = A_kD_k + B_k$ with the exact Jacobians of the sampled step, whose weights, and
their derivatives by the coordinates, come from the series of `simulate.exponential`.
"""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Float

from ..errors import InputError
from ..programs import compiled
from ..recording.runs import Runs
from ..simulation import Sampled
from ..vehicle import AbstractVehicle

_INSTEAD = "leave the compiled march out"
VehicleAt = Callable[[Array], AbstractVehicle]


class March:
    """A compiled loop over the samples of runs, for models that differ in coordinates (p,) alone.

    `vehicle_at` makes the model of coordinates. Which of its numbers they move is seen at the two points `at`; what
    they do not move is folded into the code. `start`: whether the initial states are sought as well.

    **Raises** `InputError` in single precision, where intervals between samples differ, where actuators answer to the
    coordinates or sensors to several samples, for an operation that has no form in C, and where there is no compiler.
    """

    def __init__(self, vehicle_at: VehicleAt, at: tuple[Array, Array], runs: Runs, *, start: bool):
        # CasADi is an extra
        from ..symbolic.foreign import foreign
        from .march_source import march_c

        if len(runs.steps) != 1:
            raise InputError("runs", "are sampled unevenly", _INSTEAD)
        if runs.outputs.dtype != jnp.float64:
            raise InputError("numbers", "are in single precision", "set jax_enable_x64, or " + _INSTEAD)
        models, slopes, nodes, apart = zip(*(_looked_at(vehicle_at, y, runs) for y in at), strict=True)
        if not np.array_equal(nodes[0], nodes[1]):
            raise InputError("actuators", "answer to what is estimated", _INSTEAD)
        if not all(bool(alike) for alike in apart):
            raise InputError("sensors", "answer to more than the sample they are read at", _INSTEAD)
        self._model, self._start = models[0], start
        numbers = [np.asarray(_numbers(model)) for model in models]
        moved = np.flatnonzero(numbers[0] != numbers[1])
        by = np.any([np.asarray(slope) != 0.0 for slope in slopes], axis=0)
        # the step's weights come last among the numbers, and are worked out in C
        self._others = moved[moved < _numbers((self._model.vehicle, self._model.inverse)).size]
        self._by_others = np.nonzero(by[self._others])
        source = march_c(self._model, numbers[0], moved, by[moved], runs, start=start)
        self._targets = foreign(source, ("squares", "products"))
        self._squares = _batched(functools.partial(self._call, "squares"))
        self._products = _batched(functools.partial(self._call, "products"))

    def squares(
        self, vehicle_at: VehicleAt, y: Float[Array, " p"], start: Float[Array, "r s"], runs: Runs, sigma: Array
    ) -> Float[Array, " r"]:
        """The sum of each run's squared errors, whitened by `sigma` (c,)."""
        rows = (*self._given(vehicle_at, y), start)
        return self._squares(_members(rows), _seen(runs, sigma), self._same(runs))[0]

    def products(
        self,
        vehicle_at: VehicleAt,
        y: Float[Array, " p"],
        start: Float[Array, "r s"],
        start_std: Float[Array, " s"],
        runs: Runs,
        sigma: Array,
    ) -> Float[Array, "r q q"]:
        """Products of each run's whitened columns: by the coordinates, by its start over `start_std`, and the error."""
        given = functools.partial(self._given, vehicle_at)
        along = lambda tangent: jax.jvp(given, (y,), (tangent,))
        value, slope = jax.vmap(along, out_axes=(None, -1))(jnp.eye(y.size, dtype=y.dtype))
        rows = (*value, start, slope[0][self._by_others], slope[1])
        return self._products(_members(rows), _seen(runs, sigma), (*self._same(runs), start_std))[0]

    def _given(self, vehicle_at: VehicleAt, y: Array) -> tuple[Array, Array]:
        """The numbers that the coordinates move but the weights, and the linear part that these are of."""
        vehicle = vehicle_at(y)
        inverse = jnp.linalg.inv(vehicle.mass_matrix())
        return _numbers((vehicle, inverse))[self._others], inverse @ vehicle.damping_matrix()

    def _same(self, runs: Runs) -> tuple[Array, Array]:
        """What all members share: signals of each interval, and the step."""
        nodes = _nodes(self._model.vehicle, runs)
        return nodes.reshape(*nodes.shape[:2], -1), runs.steps / runs.substeps

    def _call(self, what: str, rows: tuple[Array, ...], seen: Array, same: tuple[Array, ...]) -> Array:
        other, linear, start, *slopes = rows
        nodes, h, *start_std = same
        shape = start.shape[:2]
        if what == "products":
            width = slopes[1].shape[-1] + (start.shape[-1] if self._start else 0) + 1
            shape = (*shape, width, width)
        like = jax.ShapeDtypeStruct(shape, start.dtype)
        arrays = (other, linear, start, nodes, seen, h, *slopes, *start_std)
        return jax.ffi.ffi_call(self._targets[what], like)(*arrays)


def _batched(of: Callable[[tuple, Array, tuple], Array]) -> Callable[[tuple, Array, tuple], Array]:
    """`of` rows (N, …), what is seen (1 or N, R, K, Q) and what is the same for all; a batch makes N longer."""

    @custom_vmap
    def run(rows: tuple, seen: Array, same: tuple) -> Array:
        return of(rows, seen, same)

    @run.def_vmap
    def _(size: int, batched: list, rows: tuple, seen: Array, same: tuple) -> tuple[Array, bool]:
        if any(batched[2]):
            raise InputError("members of a batch", "differ in their runs' inputs", _INSTEAD)
        count = rows[0].shape[int(batched[0][0])]
        longer = lambda a, is_batched: a if is_batched else jnp.broadcast_to(a, (size, *a.shape))
        flat = lambda a: a.reshape(size * count, *a.shape[2:])
        rows = tuple(flat(longer(a, b)) for a, b in zip(rows, batched[0], strict=True))
        if batched[1] or len(seen) > 1:
            whole = longer(seen, batched[1])
            seen = flat(jnp.broadcast_to(whole, (size, count, *whole.shape[2:])))
        found = run(rows, seen, same)
        return found.reshape(size, count, *found.shape[1:]), True

    return run


def _members(rows: tuple[Array, ...]) -> tuple[Array, ...]:
    return tuple(array[None] for array in rows)


def _numbers(model: object) -> Array:
    return jnp.concatenate([leaf.ravel() for leaf in jax.tree.leaves(eqx.filter(model, eqx.is_inexact_array))])


def _nodes(vehicle: AbstractVehicle, runs: Runs) -> Array:
    return jax.vmap(vehicle.actuate)(runs.times, runs.nodes())


def _seen(runs: Runs, sigma: Array) -> Float[Array, "1 r k q"]:
    """Time, signals, measured outputs and the weight of each, zero where missing."""
    weight = jnp.where(runs.mask, 1.0 / sigma, 0.0)
    return jnp.concatenate([runs.times[..., None], runs.signals, runs.outputs, weight], axis=-1)[None]


@compiled
def _looked_at(vehicle_at: VehicleAt, y: Array, runs: Runs) -> tuple[Sampled, Array, Array, Array]:
    """The model at coordinates, the derivatives of its numbers by them, the signals that it is driven by.

    And whether its sensors show the same of one sample as of all, the states being any.
    """
    model_at = lambda y: Sampled.of(vehicle_at(y), runs)
    vehicle, layout = vehicle_at(y), vehicle_at(y).layout
    size = (*runs.times.shape, len(layout.equations) + len(layout.positions))
    # by NumPy: to compile a generator of random numbers takes seconds
    states = jnp.asarray(np.random.default_rng(0).standard_normal(size))
    one = lambda time, state, signals: vehicle.measure(time[None], state[None], signals[None])[0]
    alone = jax.vmap(jax.vmap(one))(runs.times, states, runs.signals)
    alike = jnp.allclose(alone, vehicle.measure(runs.times, states, runs.signals), equal_nan=True)
    return model_at(y), jax.jacfwd(lambda y: _numbers(model_at(y)))(y), _nodes(vehicle, runs), alike
