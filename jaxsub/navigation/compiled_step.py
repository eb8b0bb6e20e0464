"""A stream's step compiled ahead of time, for a flight loop that has microseconds.

A call costs the host about a microsecond for each array that goes in or comes out, and for each kernel that the program
starts; a stream's state, a reading and an estimate together have some forty. Here all numbers of one type travel in one
array: a state stays packed from call to call, and is unpacked when it is read.

`native` makes C of the step, which has no kernels to start and takes half as long; it needs a C compiler and CasADi.

By default JAX hands a program on the CPU to another thread and waits for it. A loop that is alone in its process saves
that by `jax.config.update("jax_cpu_enable_async_dispatch", False)` before anything is computed.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..errors import InputError
from .stream import AbstractStream

Packed = tuple[Array | np.ndarray, ...]
Compiled = Callable[[Packed, Packed], tuple[Packed, Packed]]
Compiler = Callable[[Compiled, Packed, Packed], Compiled]
_TRUTH = np.dtype(bool)


class _Leaf(NamedTuple):
    """Where an array lies: in the pack of number `pack`, from `first` to `last`."""

    shape: tuple[int, ...]
    dtype: np.dtype
    pack: int
    first: int
    last: int


class _Layout:
    """How a pytree of arrays lies in flat ones, one of each type; truth values are ones and zeros among the rest.

    Or all in one of type `one`.
    """

    def __init__(self, like: Any, one: np.dtype | None = None):
        leaves, self.structure = jax.tree.flatten(like)
        kinds = [np.dtype(leaf.dtype) for leaf in leaves]
        self.kinds = sorted(set(kinds) - {_TRUTH}, key=str) or [np.dtype(np.int32)]
        self.kinds = self.kinds if one is None else [one]
        ends, self.leaves = [0] * len(self.kinds), []
        for leaf, kind in zip(leaves, kinds, strict=True):
            pack = self.kinds.index(kind) if kind in self.kinds else 0
            first = ends[pack]
            ends[pack] += math.prod(leaf.shape)
            self.leaves.append(_Leaf(leaf.shape, kind, pack, first, ends[pack]))
        self.sizes = tuple(ends)

    def packed(self, tree: Any) -> Packed:
        """The arrays of `tree` within a program."""
        parts: list[list[Array]] = [[] for _ in self.kinds]
        for at, leaf in zip(self.leaves, jax.tree.leaves(tree), strict=True):
            # double precision is the caller's choice
            parts[at.pack].append(jnp.ravel(leaf).astype(jnp.result_type(self.kinds[at.pack])))
        return tuple(jnp.concatenate(part) for part in parts)

    def given(self, tree: Any, where: str) -> tuple[np.ndarray, ...]:
        """The arrays of `tree` on the host, if they are like those of the layout."""
        leaves, structure = jax.tree.flatten(tree)
        packs = tuple(np.empty(size, kind) for size, kind in zip(self.sizes, self.kinds, strict=True))
        sound = structure == self.structure
        for at, leaf in zip(self.leaves, leaves, strict=False):
            leaf = np.asarray(leaf)
            sound = sound and leaf.shape == at.shape and leaf.dtype == at.dtype
            if sound:
                packs[at.pack][at.first : at.last] = leaf.ravel()
        if not sound:
            what = "not of the shapes and types that the step was compiled for"
            raise InputError(where, what, "give arrays like those given to ahead_of_time")
        return packs

    def unpacked(self, packs: Any) -> Any:
        """The pytree again, of views as far as possible."""
        leaves = []
        for at in self.leaves:
            part = packs[at.pack][at.first : at.last]
            part = part if len(at.shape) == 1 else part.reshape(at.shape)
            leaves.append(part if part.dtype == at.dtype else part.astype(at.dtype))
        return jax.tree.unflatten(self.structure, leaves)


def _by_xla(call: Compiled, state: Packed, seen: Packed) -> Compiled:
    return jax.jit(call).lower(state, seen).compile()


def _by_c(call: Compiled, state: Packed, seen: Packed) -> Compiled:
    # an extra that the other way does without
    from ..symbolic import casadi_function, compiled

    program = compiled(casadi_function(call, state, seen, name="step"))

    def run(state: Packed, seen: Packed) -> tuple[Packed, Packed]:
        # of the thread that calls
        (state_in, seen_in), (state_out, found) = program.given, program.found
        state_in[:], seen_in[:] = state[0], seen[0]
        program()
        return (state_out.copy(),), (found.copy(),)

    return run


class Program:
    """A step `(state, reading) -> (state, estimate)` for the shapes and types that it was compiled for."""

    def __init__(
        self,
        step: Callable[[Any, Any], tuple[Any, Any]],
        state: Any,
        reading: Any,
        *,
        compiler: "Callable[[Compiled, Packed, Packed], Compiled]" = lambda call, *like: (
            jax.jit(call).lower(*like).compile()
        ),
        one: np.dtype | None = None,
    ):
        """What else the step uses becomes part of the program; `compiler` is given the shapes of one call.

        Numbers travel in one array of each type, or all in one of type `one`.
        """
        self._state, self._reading = _Layout(state, one), _Layout(reading, one)
        self._estimate = _Layout(jax.eval_shape(step, state, reading)[1], one)

        def packed(state: Packed, seen: Packed) -> tuple[Packed, Packed]:
            after, estimate = step(self._state.unpacked(state), self._reading.unpacked(seen))
            return self._state.packed(after), self._estimate.packed(estimate)

        self._compiled = compiler(packed, self.pack(state), self._reading.given(reading, "reading"))

    def pack(self, state: Any) -> Packed:
        """`state` as `step` takes it; **raises** `InputError` for other shapes or types."""
        return self._state.given(state, "state")

    def unpack(self, packed: Packed) -> Any:
        """The state that was `packed` again, of JAX's arrays."""
        return jax.tree.map(jnp.asarray, self._state.unpacked(packed))

    def step(self, packed: Packed, reading: Any) -> tuple[Packed, Any]:
        """The next state, packed, and what is known after `reading`, in NumPy's arrays.

        A reading of NumPy's arrays spares the way through JAX's. **Raises** `InputError` for a reading of other shapes
        or types.
        """
        packed, found = self._compiled(packed, self._reading.given(reading, "reading"))
        return packed, self._estimate.unpacked([np.asarray(part) for part in found])


def ahead_of_time(stream: AbstractStream, state: Any, reading: Any) -> Program:
    """`stream.step` compiled for states and readings like these.

    In a flight loop: `packed = program.pack(state)`, then `packed, estimate = program.step(packed, reading)` for each.
    """
    return Program(stream.step, state, reading)


def native(step: Callable[[Any, Any], tuple[Any, Any]], state: Any, reading: Any) -> Program:
    """The same of any `step`, by way of C, in double precision: `native(stream.step, state, reading)`.

    C code for another processor: `jaxsub.symbolic.write_c(casadi_function(step, state, reading), path)`. **Raises**
    `InputError` where CasADi or a C compiler is missing, and for a step with an operation that has no counterpart in C.
    """
    return Program(step, state, reading, compiler=_by_c, one=np.dtype(np.float64))
