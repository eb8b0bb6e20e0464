"""A plant in CasADi: the same step and outputs as a `casadi.Function`, to optimise over or to generate C from."""

from typing import TYPE_CHECKING

import jax.numpy as jnp
from jaxtyping import Array

from .plant import Plant

if TYPE_CHECKING:
    import casadi


def casadi_plant(plant: Plant, name: str = "plant") -> "casadi.Function":
    """The `casadi.Function` (x, u, t) ↦ (x_next, y) of `plant`, SI, under `name`; t is the time of the sample, s.

    It is made of the program that JAX runs, with the vehicle's numbers as constants, so that it differs from the plant
    by rounding alone; `symbolic.write_c` makes C of it.

    **Raises** `InputError` where CasADi is not installed, and where an effect computes what CasADi cannot.
    """
    from ..symbolic import casadi_function

    def both(x: Array, u: Array, t: Array) -> tuple[Array, Array]:
        return plant.step(x, u, t), plant.output(x, u, t)

    kind = plant.constants.dtype
    examples = (jnp.zeros(len(plant.states), kind), jnp.zeros(len(plant.inputs), kind), jnp.zeros((), kind))
    return casadi_function(both, *examples, name=name, arguments=("x", "u", "t"), results=("x_next", "y"))


def casadi_jacobians(function: "casadi.Function") -> "casadi.Function":
    """The `casadi.Function` (x, u, t) ↦ (A, B, C, D) of `function`, one by `casadi_plant`, by CasADi's derivatives."""
    from ..symbolic import casadi

    x, u, t = (casadi.SX.sym(key, function.size1_in(key)) for key in ("x", "u", "t"))
    parts = function(x, u, t)
    found = [casadi.jacobian(part, by) for part in parts for by in (x, u)]
    return casadi.Function(f"{function.name()}_jacobians", [x, u, t], found, ["x", "u", "t"], ["A", "B", "C", "D"])
