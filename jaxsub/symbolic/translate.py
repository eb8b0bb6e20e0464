"""A jaxpr, evaluated on CasADi's numbers.

Loops are unrolled and both sides of a branch computed, since CasADi's `SX` graphs have neither; what does not depend on
the arguments is folded. All is in double precision, whatever the program's types.
"""

from collections.abc import Callable, Sequence
from typing import Any

import casadi
import jax
import numpy as np

from ..errors import InputError
from .arrays import (
    MOVES,
    as_array,
    cholesky,
    dot,
    extreme_at,
    gather_at,
    move,
    reduced,
    running,
    slice_at,
    solved,
    triangular,
    unit_vectors,
    update_at,
)
from .scalars import (
    ELEMENTWISE,
    boxed,
    choose,
    converted,
    integer_power,
    known,
    mapped,
    rounded,
    selected,
    settled,
)

# of numbers, or results of factorisations that have no counterpart
Arrays = list[Any]
_CALLS = ("jaxpr", "call_jaxpr", "fun_jaxpr")
_MAX_STEPS = 10_000


def casadi_function(
    call: Callable[..., Any], *like: Any, name: str = "f", arguments: Sequence[str] = (), results: Sequence[str] = ()
) -> "casadi.Function":
    """`call` as a CasADi function of `SX`, with derivatives of its own and C code.

    - `like`: arguments as `call` takes them, pytrees of arrays; only their shapes count.
    - `arguments`, `results`: names for every array in and out, in the order in which `jax.tree.leaves` has them; by
      default `x0`, `x1`, … and `y0`, `y1`, ….

    Numbers and vectors are columns, matrices are matrices, and arrays of more axes are columns in row-major order.

    **Raises** `InputError` for an operation that has no counterpart, by name: loops whose end the arguments decide,
    random numbers, and factorisations other than Cholesky's.
    """
    leaves, structure = jax.tree.flatten(like)
    flat = lambda *given: jax.tree.leaves(call(*jax.tree.unflatten(structure, given)))
    closed = jax.make_jaxpr(flat)(*leaves)
    names = list(arguments) or [f"x{i}" for i in range(len(leaves))]
    symbols = [casadi.SX.sym(n, *_columns(np.shape(leaf))) for n, leaf in zip(names, leaves, strict=True)]
    given = [_array(symbol, np.shape(leaf)) for symbol, leaf in zip(symbols, leaves, strict=True)]
    found = [_matrix(array) for array in evaluate(closed, given)]
    return casadi.Function(name, symbols, found, names, list(results) or [f"y{i}" for i in range(len(found))])


def _columns(shape: Sequence[int]) -> tuple[int, int]:
    return (shape[0], shape[1]) if len(shape) == 2 else (int(np.prod(shape, dtype=int)), 1)


def _array(symbol: Any, shape: Sequence[int]) -> np.ndarray:
    """The elements of a CasADi matrix."""
    rows, columns = _columns(shape)
    found = np.empty((rows, columns), object)
    for place in np.ndindex(rows, columns):
        found[place] = symbol[place]
    return found.reshape(shape)


def _matrix(array: Any) -> Any:
    if isinstance(array, _Unknown):
        raise _unsupported(array.name)
    rows, columns = _columns(array.shape)
    if array.size == 0:
        return casadi.SX(rows, columns)
    listed = array.reshape(rows, columns).tolist()
    return casadi.densify(casadi.vertcat(*(casadi.horzcat(*row) for row in listed)))


def evaluate(closed: Any, given: Sequence[Any]) -> Arrays:
    """A jaxpr, closed or without constants, on arrays of numbers, known and not."""
    values: dict[Any, Any] = {}
    jaxpr = getattr(closed, "jaxpr", closed)
    values.update(zip(jaxpr.constvars, map(as_array, getattr(closed, "consts", ())), strict=True))
    values.update(zip(jaxpr.invars, given, strict=True))
    read = lambda atom: as_array(atom.val) if hasattr(atom, "val") else values[atom]
    for equation in jaxpr.eqns:
        found = _applied(equation, [read(atom) for atom in equation.invars])
        for variable, array in zip(equation.outvars, found, strict=True):
            if not isinstance(array, _Unknown):
                array = settled(array).reshape(variable.aval.shape)
            values[variable] = array
    return [read(atom) for atom in jaxpr.outvars]


class _Unknown:
    """The result of a factorisation that has no counterpart: an error only where it is used."""

    def __init__(self, name: str):
        self.name = name


def _applied(equation: Any, operands: Arrays) -> Arrays:
    """What one equation of a jaxpr makes."""
    name, params = equation.primitive.name, equation.params
    if name == "custom_linear_solve":
        return _linear_solve(params, operands)
    lost = next((operand.name for operand in operands if isinstance(operand, _Unknown)), None)
    if lost is not None:
        raise _unsupported(lost)
    if name in _CONTROL:
        return _CONTROL[name](params, operands)
    if any(key in params and hasattr(params[key], "eqns") for key in _CALLS):
        inner = next(params[key] for key in _CALLS if key in params)
        return evaluate(inner, operands)
    if all(map(known, operands)):
        found = equation.primitive.bind(*operands, **params)
        return [as_array(one) for one in (found if equation.primitive.multiple_results else [found])]
    return _symbolic(equation, operands)


def _symbolic(equation: Any, operands: Arrays) -> Arrays:
    """One equation that is not a loop, a branch or a call, some of its operands CasADi's."""
    name, params = equation.primitive.name, equation.params
    if name == "div" and np.issubdtype(equation.outvars[0].aval.dtype, np.integer):
        raise _unsupported("division of integers")
    if name in ELEMENTWISE:
        return [mapped(ELEMENTWISE[name], *operands)]
    if name in _ARRAYS:
        return [_ARRAYS[name](params, operands)]
    bind = lambda *given: equation.primitive.bind(*given, **params)
    if name in MOVES:
        moving = MOVES[name]
        if moving is None or all(known(operands[i]) for i in range(len(operands)) if i not in moving):
            return move(bind, operands, moving)
    if name == "gather":
        return [gather_at(bind, operands[0], operands[1], params)]
    if name in ("lu", "qr", "geqrf", "lu_pivots_to_permutation"):
        return [_Unknown(name) for _ in equation.outvars]
    raise _unsupported(name)


def _unsupported(name: str) -> InputError:
    return InputError("CasADi", f"`{name}` has no counterpart", "write the function without it, or use jax.export")


def _slice(params: dict, operands: Arrays) -> np.ndarray:
    starts = [start.item() for start in operands[1:]]
    return slice_at(operands[0], starts, params["slice_sizes"])


def _scattered_sum(params: dict, operands: Arrays) -> np.ndarray:
    """Each update has its own place, which a unit update shows."""
    operand, indices, updates = operands
    place = lambda unit: jax.lax.scatter_add(
        np.zeros(operand.shape), indices, unit, params["dimension_numbers"], mode=params["mode"]
    )
    shown = jax.vmap(place)(unit_vectors(updates.shape))
    found = operand.astype(object)
    for at, value in zip(np.asarray(shown), updates.ravel(), strict=True):
        found = mapped(lambda here, so_far, more=value: so_far + more if here else so_far, at, found)
    return found


_ARRAYS: dict[str, Callable[[dict, Arrays], np.ndarray]] = {
    "select_n": lambda params, x: selected(x[0], x[1:]),
    "convert_element_type": lambda params, x: converted(x[0], params["new_dtype"]),
    "integer_pow": lambda params, x: integer_power(x[0], params["y"]),
    "round": lambda params, x: rounded(x[0], params["rounding_method"] == jax.lax.RoundingMethod.TO_NEAREST_EVEN),
    "dot_general": lambda params, x: dot(x[0], x[1], params["dimension_numbers"]),
    "argmax": lambda params, x: extreme_at(x[0], params["axes"][0], True),
    "argmin": lambda params, x: extreme_at(x[0], params["axes"][0], False),
    "cumsum": lambda params, x: running(x[0], params["axis"], params["reverse"], "sum"),
    "cumprod": lambda params, x: running(x[0], params["axis"], params["reverse"], "prod"),
    "cummax": lambda params, x: running(x[0], params["axis"], params["reverse"], "max"),
    "cummin": lambda params, x: running(x[0], params["axis"], params["reverse"], "min"),
    "cholesky": lambda params, x: cholesky(x[0]),
    "scatter-add": _scattered_sum,
    "scatter_add": _scattered_sum,
    "triangular_solve": lambda params, x: triangular(
        x[0],
        x[1],
        left_side=params["left_side"],
        lower=params["lower"],
        transpose_a=params["transpose_a"],
        unit=params["unit_diagonal"],
    ),
    **{
        f"reduce_{kind}": lambda params, x, kind=kind: reduced(x[0], [int(axis) for axis in params["axes"]], kind)
        for kind in ("sum", "prod", "max", "min", "and", "or")
    },
}


def _branches(params: dict, operands: Arrays) -> Arrays:
    """`cond` and `switch`: the branch that is known, or all, of which one is chosen later."""
    which, given, branches = operands[0], operands[1:], params["branches"]
    if known(which):
        return evaluate(branches[int(np.clip(which, 0, len(branches) - 1))], given)
    sides = [evaluate(branch, given) for branch in branches]
    index, last = which.item(), len(branches) - 1
    found = sides[last]
    for number in reversed(range(last)):
        pick = lambda yes, no, n=number: choose(index <= n, yes, no)
        found = [mapped(pick, yes, no) for yes, no in zip(sides[number], found, strict=True)]
    return [settled(array) for array in found]


def _scan(params: dict, operands: Arrays) -> Arrays:
    constants, carry, rows = _scanned(params, operands)
    made: list[Arrays] = []
    order = range(params["length"])
    for k in reversed(order) if params["reverse"] else order:
        found = evaluate(params["jaxpr"], [*constants, *carry, *(_row(row, k) for row in rows)])
        carry, shown = found[: len(carry)], found[len(carry) :]
        made.append(shown)
    made = made[::-1] if params["reverse"] else made
    return [*carry, *(settled(np.stack([boxed(a) for a in each])) for each in zip(*made, strict=True))]


def _scanned(params: dict, operands: Arrays) -> tuple[Arrays, Arrays, Arrays]:
    """Constants, what is carried, and rows, which releases of JAX tell apart in two ways."""
    if "ft_in" in params:
        constants, carry, rows = params["ft_in"].update(operands).unpack()
        return list(constants), list(carry), list(rows)
    first, last = params["num_consts"], params["num_consts"] + params["num_carry"]
    return operands[:first], operands[first:last], operands[last:]


def _row(rows: np.ndarray, k: int) -> np.ndarray:
    return rows[k] if known(rows) else boxed(rows[k])


def _while(params: dict, operands: Arrays) -> Arrays:
    a, b = params["cond_nconsts"], params["body_nconsts"]
    asked, constants, carry = operands[:a], operands[a : a + b], operands[a + b :]
    for _ in range(_MAX_STEPS):
        (going,) = evaluate(params["cond_jaxpr"], [*asked, *carry])
        if not known(going):
            raise _unsupported("while, with an end that depends on the arguments,")
        if not going:
            return carry
        carry = evaluate(params["body_jaxpr"], [*constants, *carry])
    raise _unsupported(f"while, of more than {_MAX_STEPS} steps,")


def _linear_solve(params: dict, operands: Arrays) -> Arrays:
    """By the matrix that the product with unit vectors shows: a factorisation may have no counterpart."""
    counts, programs = params["const_lengths"], params["jaxprs"]
    constants, right = operands[: counts.matvec], operands[sum(counts) :]
    if len(right) != 1:
        raise _unsupported("a linear system of several arrays")
    b = right[0]
    columns = [evaluate(programs.matvec, [*constants, unit])[0].ravel() for unit in unit_vectors(b.shape)]
    return [solved(settled(np.stack(columns)), b.ravel()).reshape(b.shape)]


_CONTROL: dict[str, Callable[[dict, Arrays], Arrays]] = {
    "cond": _branches,
    "scan": _scan,
    "while": _while,
    "optimization_barrier": lambda params, operands: operands,
}
_ARRAYS["dynamic_slice"] = _slice
_ARRAYS["dynamic_update_slice"] = lambda params, x: update_at(x[0], x[1], [start.item() for start in x[2:]])
