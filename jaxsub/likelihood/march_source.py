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
from ..simulate import Sampled
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
    layout = model.vehicle.layout
    states, channels = len(layout.equations) + len(layout.positions), runs.outputs.shape[-1]
    signals = 3 * (runs.signals.shape[-1] + 1)
    seen = 1 + runs.signals.shape[-1] + 2 * channels
    th, x = casadi.SX.sym("th", len(moved)), casadi.SX.sym("x", states)
    u, z = casadi.SX.sym("u", signals), casadi.SX.sym("z", seen)
    full = casadi.SX(casadi.DM(numbers))
    for place, number in enumerate(moved):
        full[int(number)] = th[place]
    step, shown = _taken_apart(model, len(numbers), states, signals, seen, channels)
    D = casadi.SX.sym("D", casadi.Sparsity.triplet(*by.shape, *(list(map(int, where)) for where in np.nonzero(by))))
    after = casadi.densify(step(full, x, u))
    weight = z[seen - channels :]
    error = casadi.if_else(weight != 0, weight * shown(full, x, z), 0)
    A, B = casadi.jacobian(after, x), casadi.jacobian(after, th) @ D
    slope, direct = casadi.jacobian(error, x), casadi.jacobian(error, th) @ D
    rows = lambda *matrices: [matrix.T for matrix in matrices]
    functions = [
        casadi.Function("step", [th, x, u], [after]),
        casadi.Function("slopes", [th, x, u, D], [after, *rows(A, B)], {"cse": True}),
        casadi.Function("shown", [th, x, z], [error]),
        casadi.Function("shown_slopes", [th, x, z, D], [error, *rows(slope, direct)], {"cse": True}),
    ]
    equations = model.inverse.shape[0]
    before = len(numbers) - _WEIGHTS * equations**2
    others = np.flatnonzero(moved < before)
    # C counts the weights downwards from -1
    from_th = np.where(moved < before, np.cumsum(moved < before) - 1, before - 1 - moved)
    order = np.cumsum(by[others]).reshape(by[others].shape) - 1
    at, coordinate = (np.array(list(where), int) for where in D.sparsity().get_triplet())
    weights = -1 - ((moved[at] - before) * by.shape[1] + coordinate)
    from_D = np.array(
        [order[from_th[t], j] if moved[t] < before else w for t, j, w in zip(at, coordinate, weights, strict=True)]
    )
    sizes = {"S": states, "N": equations, "P": by.shape[1], "C": channels, "U": signals, "Q": seen}
    sizes |= {"TH": len(moved), "TO": len(others), "ND": D.nnz(), "NDO": int(by[others].sum()), "START": int(start)}
    places = {"TH_FROM": from_th, "D_FROM": from_D}
    for name, matrix in {"A": A, "B": B, "C": slope, "X": direct}.items():
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


def _taken_apart(
    model: Sampled, count: int, states: int, signals: int, seen: int, channels: int
) -> tuple["casadi.Function", "casadi.Function"]:
    """The step and the outputs' errors, of all the model's numbers."""
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
        return vehicle.deviation(measured, vehicle.measure(time, x[None], known[None])[0])

    zeros = jnp.zeros
    return (
        casadi_function(step, zeros(count), zeros(states), zeros(signals)),
        casadi_function(shown, zeros(count), zeros(states), zeros(seen)),
    )


def _integers(name: str, values: Iterable) -> str:
    listed = list(map(int, values))
    return f"static const int {name}[] = {{{', '.join(map(str, listed or [0]))}}};"
