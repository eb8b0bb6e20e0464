"""What primitives do to whole arrays: move their elements, reduce them, multiply and solve."""

import functools
import operator
from collections.abc import Callable, Sequence
from typing import Any

import casadi
import jax
import jax.numpy as jnp
import numpy as np

from .scalars import PAIRWISE, Scalar, boxed, choose, is_symbolic, known, mapped

# primitives that only move elements, and which of their operands hold these; others hold indices, which must be known
MOVES: dict[str, tuple[int, ...] | None] = {
    "broadcast_in_dim": (0,),
    "reshape": (0,),
    "transpose": (0,),
    "squeeze": (0,),
    "expand_dims": (0,),
    "slice": (0,),
    "rev": (0,),
    "concatenate": None,
    "stack": None,
    "unstack": (0,),
    "split": (0,),
    "tile": (0,),
    "pad": (0, 1),
    "gather": (0,),
    "dynamic_slice": (0,),
    "dynamic_update_slice": (0, 1),
    "scatter": (0, 2),
}


def move(bind: Callable[..., Any], operands: Sequence[np.ndarray], moving: tuple[int, ...] | None) -> list[np.ndarray]:
    """Where elements go, found by letting the primitive move their numbers; NaN where it fills a gap."""
    numbers, flat, first = list(operands), [np.array([np.nan], object)], 1
    for i in range(len(operands)) if moving is None else moving:
        size = operands[i].size
        numbers[i] = np.arange(first, first + size, dtype=np.int32).reshape(operands[i].shape)
        flat.append(boxed(operands[i]).ravel())
        first += size
    found = bind(*map(jnp.asarray, numbers))
    source = np.concatenate(flat)
    places = found if isinstance(found, (list, tuple)) else [found]
    return [boxed(source[np.maximum(np.asarray(place), 0)]) for place in places]


def gather_at(bind: Callable[..., Any], operand: np.ndarray, indices: np.ndarray, params: dict) -> np.ndarray:
    """What `gather` takes from places that are known only later: each possible one is compared; NaN outside."""
    numbers, sizes = params["dimension_numbers"], params["slice_sizes"]
    most = [operand.shape[axis] - sizes[axis] for axis in numbers.start_index_map]
    if params["mode"] != jax.lax.GatherScatterMode.FILL_OR_DROP:
        inside = lambda i, last: PAIRWISE["min"](PAIRWISE["max"](i, 0), last)
        indices = mapped(inside, indices, np.broadcast_to(most, indices.shape))
    found: np.ndarray | None = None
    for corner in np.ndindex(*(last + 1 for last in most)):
        there = np.broadcast_to(np.asarray(corner, np.int32), indices.shape)
        (taken,) = move(bind, [operand, there], (0,))
        here = reduced(mapped(operator.eq, indices, there), [indices.ndim - 1], "and")
        axes = tuple(axis for axis in range(taken.ndim) if axis in numbers.offset_dims)
        spread = np.broadcast_to(np.expand_dims(here, axes), taken.shape)
        found = mapped(choose, spread, taken, np.nan if found is None else found)
    assert found is not None
    return found


def slice_at(operand: np.ndarray, starts: Sequence[Scalar], sizes: Sequence[int]) -> np.ndarray:
    """A slice from places that are known only later: each possible one is compared."""
    for axis, (start, size) in enumerate(zip(starts, sizes, strict=True)):
        last = operand.shape[axis] - size
        window = lambda place, x=operand, axis=axis, size=size: np.take(x, range(place, place + size), axis)
        if not is_symbolic(start):
            operand = window(int(np.clip(start, 0, last)))
            continue
        found = window(last)
        for place in reversed(range(last)):
            found = mapped(lambda yes, no, s=start, p=place: choose(s <= p, yes, no), window(place), found)
        operand = found
    return operand


def update_at(operand: np.ndarray, update: np.ndarray, starts: Sequence[Scalar]) -> np.ndarray:
    """The slice at places that are known only later replaced."""
    found = operand.copy().astype(object)
    last = [n - m for n, m in zip(operand.shape, update.shape, strict=True)]
    clipped = [PAIRWISE["min"](PAIRWISE["max"](s, 0), most) for s, most in zip(starts, last, strict=True)]
    for corner in np.ndindex(*(most + 1 for most in last)):
        tests = [start == place for start, place in zip(clipped, corner, strict=True)]
        here = functools.reduce(PAIRWISE["and"], tests)
        for offset in np.ndindex(*update.shape):
            at = tuple(c + o for c, o in zip(corner, offset, strict=True))
            found[at] = choose(here, update[offset], found[at])
    return found


def reduced(x: np.ndarray, axes: Sequence[int], kind: str) -> np.ndarray:
    """Over `axes`."""
    kept = [axis for axis in range(x.ndim) if axis not in axes]
    shape = [x.shape[axis] for axis in kept]
    rows = np.transpose(x, [*kept, *axes]).reshape([*shape, -1])
    found = np.empty(shape, object)
    for place in np.ndindex(*shape):
        found[place] = functools.reduce(PAIRWISE[kind], rows[place])
    return found


def running(x: np.ndarray, axis: int, reverse: bool, kind: str) -> np.ndarray:
    """The sum, product or extreme so far along an axis."""
    rows = np.moveaxis(x, axis, 0)[:: -1 if reverse else 1].astype(object)
    for k in range(1, len(rows)):
        rows[k] = mapped(PAIRWISE[kind], rows[k - 1], rows[k])
    return np.moveaxis(rows[:: -1 if reverse else 1], 0, axis)


def extreme_at(x: np.ndarray, axis: int, largest: bool) -> np.ndarray:
    """Where along an axis the first extreme is."""
    rows = np.moveaxis(x, axis, 0).astype(object)
    best, at = rows[0], np.zeros(rows.shape[1:], object)
    for k in range(1, len(rows)):
        better = mapped(operator.gt if largest else operator.lt, rows[k], best)
        best, at = mapped(choose, better, rows[k], best), mapped(choose, better, k, at)
    return boxed(at)


def dot(a: np.ndarray, b: np.ndarray, dimensions: Any) -> np.ndarray:
    """`dot_general`: batch axes first, then what is left of `a`, then of `b`."""
    (over_a, over_b), (batch_a, batch_b) = dimensions
    rest_a = [i for i in range(a.ndim) if i not in (*over_a, *batch_a)]
    rest_b = [i for i in range(b.ndim) if i not in (*over_b, *batch_b)]
    batch = [a.shape[i] for i in batch_a]
    summed = int(np.prod([a.shape[i] for i in over_a], dtype=int))
    left = np.transpose(a, [*batch_a, *rest_a, *over_a]).reshape([int(np.prod(batch, dtype=int)), -1, summed])
    right = np.transpose(b, [*batch_b, *over_b, *rest_b]).reshape([left.shape[0], summed, -1])
    found = np.zeros([left.shape[0], left.shape[1], right.shape[2]], object)
    for i in range(len(left)):
        found[i] = np.dot(left[i].astype(object), right[i].astype(object))
    return found.reshape([*batch, *(a.shape[i] for i in rest_a), *(b.shape[i] for i in rest_b)])


def cholesky(A: np.ndarray) -> np.ndarray:
    """The lower factor of a matrix, of which the lower triangle is read, or of many."""
    L, n = np.zeros(A.shape, object), A.shape[-1]
    for batch in np.ndindex(*A.shape[:-2]):
        for j in range(n):
            for i in range(j, n):
                left = A[(*batch, i, j)] - np.dot(L[(*batch, i, slice(j))], L[(*batch, j, slice(j))])
                L[(*batch, i, j)] = left / L[(*batch, j, j)] if i > j else _root(left)
    return L


def _root(x: Scalar) -> Scalar:
    return casadi.sqrt(x) if is_symbolic(x) else np.sqrt(x)


def triangular(
    A: np.ndarray, B: np.ndarray, *, left_side: bool, lower: bool, transpose_a: bool, unit: bool
) -> np.ndarray:
    """X with A X = B, or X A = B, for a triangular A."""
    if not left_side:
        turned = functools.partial(np.swapaxes, axis1=-1, axis2=-2)
        found = triangular(A, turned(B), left_side=True, lower=lower, transpose_a=not transpose_a, unit=unit)
        return turned(found)
    if transpose_a:
        A, lower = np.swapaxes(A, -1, -2), not lower
    n, X = A.shape[-1], B.astype(object)
    for batch in np.ndindex(*A.shape[:-2]):
        for i in range(n) if lower else reversed(range(n)):
            done = slice(i) if lower else slice(i + 1, n)
            row = X[(*batch, i)] - np.dot(A[(*batch, i, done)].astype(object), X[(*batch, done)])
            X[(*batch, i)] = row if unit else row / A[(*batch, i, i)]
    return X


def solved(columns: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The solution of a linear system that is given by the (n, n) `columns` that it makes of unit vectors."""
    A = columns.T
    if known(A) and known(right):
        return np.linalg.solve(A, right)
    sparse = casadi.sparsify(casadi.vertcat(*(casadi.horzcat(*row) for row in A.tolist())))
    found = casadi.solve(sparse, casadi.vertcat(*right.tolist()))
    return np.array(casadi.vertsplit(found), object)


def unit_vectors(shape: Sequence[int]) -> np.ndarray:
    """(n, *shape) each with one one."""
    return np.eye(int(np.prod(shape, dtype=int))).reshape([-1, *shape])


def as_array(value: Any) -> np.ndarray:
    """Of what JAX keeps in a program."""
    return np.asarray(jax.device_get(value))
