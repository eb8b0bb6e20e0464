"""The C of a march: a model's step and outputs taken apart to numbers, their Jacobians, and the loop over samples."""

from collections.abc import Iterable
from pathlib import Path

import casadi
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..recording.runs import Runs
from ..simulation import Sampled
from ..symbolic import casadi_function
from ..symbolic.lanes import HEADER, lanes_c

_LOOP = Path(__file__).with_name("march.c")
# of the step: full, half, stage, first, middle, last
_WEIGHTS = 6


def march_c(model: Sampled, numbers: np.ndarray, moved: np.ndarray, by: np.ndarray, runs: Runs, *, start: bool) -> str:
    """C with the functions `squares` and `products`, called by XLA.

    - `model`: one of the models; `numbers`: (a,) all of its numbers, the step's weights last.
    - `moved`: (t,) which of them differ from model to model. `by`: (t, p) which coordinates each depends on.
    """
    functions, slopes, derivatives = _functions(model, numbers, moved, by, runs)
    equations = model.inverse.shape[0]
    sizes = {"N": equations, "P": by.shape[1], "TH": len(moved), "ND": derivatives.nnz(), "START": int(start)}
    sizes |= {"S": functions[0].nnz_out(0), "U": functions[0].nnz_in(2)}
    sizes |= {"C": functions[2].nnz_out(0), "Q": functions[2].nnz_in(2), "COUNTING": int(any(runs.counted))}
    weights = moved >= len(numbers) - _WEIGHTS * equations**2
    places = _sources(moved - (len(numbers) - _WEIGHTS * equations**2), weights, by, derivatives)
    sizes |= {"TO": int(np.sum(~weights)), "NDO": int(by[~weights].sum())}
    places["COUNTED"] = runs.counted
    for name, matrix in slopes.items():
        # by rows, as C goes through them
        pattern = matrix.T.sparsity()
        sizes[f"N{name}"] = pattern.nnz()
        places |= {f"{name}_BEGIN": pattern.colind(), f"{name}_PLACE": pattern.row()}
    return "\n".join(
        [
            HEADER.read_text(encoding="utf-8"),
            *(f"#define {name} {value}" for name, value in sizes.items()),
            *(_integers(name, values) for name, values in places.items()),
            *map(lanes_c, functions),
            _LOOP.read_text(encoding="utf-8"),
        ]
    )


def _functions(
    model: Sampled, numbers: np.ndarray, moved: np.ndarray, by: np.ndarray, runs: Runs
) -> tuple[list["casadi.Function"], dict[str, "casadi.SX"], "casadi.Sparsity"]:
    """The model's functions as C has them, the Jacobians among their results, and where the numbers' slopes are."""
    layout, channels = model.vehicle.layout, runs.outputs.shape[-1]
    states, inputs = len(layout.equations) + len(layout.positions), runs.signals.shape[-1]
    sizes = {"th": len(moved), "x": states, "u": 3 * (inputs + 1), "z": 1 + inputs + 2 * channels}
    th, x, u, z = (casadi.SX.sym(name, size) for name, size in sizes.items())
    full = casadi.SX(casadi.DM(numbers))
    for place, number in enumerate(moved):
        full[int(number)] = th[place]
    step, shown = _taken_apart(model, len(numbers), sizes["x"], sizes["u"], sizes["z"], runs.counted)
    pattern = casadi.Sparsity.triplet(*by.shape, *(list(map(int, where)) for where in np.nonzero(by)))
    D = casadi.SX.sym("D", pattern)
    after = casadi.densify(step(full, x, u))
    weight = z[sizes["z"] - channels :]
    error = casadi.if_else(weight != 0, weight * shown(full, x, z), 0)
    slopes = {"A": casadi.jacobian(after, x), "B": casadi.jacobian(after, th) @ D}
    slopes |= {"C": casadi.jacobian(error, x), "X": casadi.jacobian(error, th) @ D}
    shared = {"cse": True}
    functions = [
        casadi.Function("step", [th, x, u], [after]),
        casadi.Function("slopes", [th, x, u, D], [after, slopes["A"].T, slopes["B"].T], shared),
        casadi.Function("shown", [th, x, z], [error]),
        casadi.Function("shown_slopes", [th, x, z, D], [error, slopes["C"].T, slopes["X"].T], shared),
    ]
    return functions, slopes, pattern


def _sources(index: np.ndarray, weights: np.ndarray, by: np.ndarray, pattern: "casadi.Sparsity") -> dict[str, Iterable]:
    """Where C finds each number, and each slope: among those it is given, or counted downwards from -1, among weights.

    `index`: (t,) of each number among the step's weights, where it is one of `weights`.
    """
    given = by[~weights]
    order, rank = np.cumsum(given).reshape(given.shape) - 1, np.cumsum(~weights) - 1
    number, coordinate = (np.array(list(where), int) for where in pattern.get_triplet())
    slopes = [
        -1 - (index[n] * by.shape[1] + j) if weights[n] else order[rank[n], j]
        for n, j in zip(number, coordinate, strict=True)
    ]
    return {"TH_FROM": np.where(weights, -1 - index, rank), "D_FROM": slopes}


def _taken_apart(
    model: Sampled, count: int, states: int, signals: int, seen: int, counted: tuple[bool, ...]
) -> tuple["casadi.Function", "casadi.Function"]:
    """The step and the outputs' errors, of all the model's numbers; those whose turns are counted not wrapped."""
    channels = len(counted)
    arrays, rest = eqx.partition(model, eqx.is_inexact_array)
    leaves, structure = jax.tree.flatten(arrays)
    ends = np.cumsum([leaf.size for leaf in leaves])

    def put_together(numbers: Array) -> Sampled:
        parts = jnp.split(numbers, ends[:-1])
        shaped = [part.reshape(leaf.shape) for part, leaf in zip(parts, leaves, strict=True)]
        return eqx.combine(jax.tree.unflatten(structure, shaped), rest)

    def step(numbers: Array, x: Array, u: Array) -> Array:
        return put_together(numbers).step(x, u.reshape(3, -1), jnp.asarray(0))

    def shown(numbers: Array, x: Array, z: Array) -> Array:
        vehicle = put_together(numbers).vehicle
        time, known, measured, _ = jnp.split(z, [1, seen - 2 * channels, seen - channels])
        modelled = vehicle.measure(time, x[None], known[None])[0]
        wrapped, whole = vehicle.deviation(measured, modelled), measured - modelled
        return jnp.stack([whole[i] if counted[i] else wrapped[i] for i in range(channels)])

    zeros = jnp.zeros
    return (
        casadi_function(step, zeros(count), zeros(states), zeros(signals)),
        casadi_function(shown, zeros(count), zeros(states), zeros(seen)),
    )


def _integers(name: str, values: Iterable) -> str:
    listed = list(map(int, values))
    return f"static const int {name}[] = {{{', '.join(map(str, listed or [0]))}}};"
