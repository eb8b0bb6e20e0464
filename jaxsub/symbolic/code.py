"""C of a CasADi function: a file for a processor that has nothing else, and the same compiled and called from here."""

import ctypes
import os
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

import casadi
import numpy as np

from .compiler import compile_library

_FLAGS = ("-O1", "-fno-math-errno", "-shared", "-fPIC")
_POINTERS = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))


def write_c(function: "casadi.Function", path: Path) -> None:
    """Write `function` to `path` as C99 that needs `math.h` alone, and allocates nothing.

    It is called as `int NAME(const double** arg, double** res, long long* iw, double* w, int mem)`, where `arg` and
    `res` point to its arrays in and out, by columns, and `w` to the scratch memory whose size `NAME_work` tells.
    """
    # a name of its own, since two processes may write one path
    unfinished = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.part")
    try:
        unfinished.write_text(_c(function), encoding="utf-8")
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def _c(function: "casadi.Function") -> str:
    generator = casadi.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    return generator.dump()


class Native:
    """A CasADi function, compiled, on arrays that stay where they are: a call costs microseconds.

    The lock of the interpreter is released in a call, so each thread has arrays of its own and sees none that
    another has filled.

    **Fields**

    - `given`, `found`: this thread's arrays in and out, flat and by columns, which the caller fills and reads.
    """

    def __init__(self, function: "casadi.Function", library: Path):
        self._library = ctypes.CDLL(str(library))
        self._call = self._library[function.name()]
        self._call.argtypes = [_POINTERS, _POINTERS, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
        self._own = _Buffers(
            [int(function.nnz_in(i)) for i in range(function.n_in())],
            [int(function.nnz_out(i)) for i in range(function.n_out())],
            (int(function.sz_arg()), int(function.sz_res())),
            (int(function.sz_iw()), int(function.sz_w())),
        )

    @property
    def given(self) -> list[np.ndarray]:
        """The arrays in."""
        return self._own.given

    @property
    def found(self) -> list[np.ndarray]:
        """The arrays out."""
        return self._own.found

    def __call__(self) -> None:
        """`found` of `given`. **Raises** `RuntimeError` where the code says that it failed."""
        if self._call(*self._own.arguments):
            raise RuntimeError("compiled code: returned an error; compile it again")


class _Buffers(threading.local):
    """Arrays of a call; `__init__` runs in each thread at its first use."""

    def __init__(self, given: Sequence[int], found: Sequence[int], pointers: tuple[int, int], work: tuple[int, int]):
        self.given, self.found = [[np.zeros(max(size, 1)) for size in sizes] for sizes in (given, found)]
        self._whole, self._scratch = np.zeros(max(work[0], 1), np.int64), np.zeros(max(work[1], 1))
        arrays = _pointers(self.given, pointers[0]), _pointers(self.found, pointers[1])
        self.arguments = (*arrays, self._whole.ctypes.data, self._scratch.ctypes.data, 0)


def _pointers(arrays: Sequence[np.ndarray], count: int) -> ctypes.Array:
    kind = ctypes.POINTER(ctypes.c_double)
    listed = [array.ctypes.data_as(kind) for array in arrays]
    return (kind * max(count, len(listed), 1))(*listed)


def compiled(function: "casadi.Function") -> Native:
    """The function compiled by the C compiler of this machine, `$CC` or `cc`.

    **Raises** `InputError` where there is none or it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / f"{function.name()}.so"
        compile_library(_c(function), library, _FLAGS, (("-lm",),))
        # it stays mapped when its file is gone
        return Native(function, library)
