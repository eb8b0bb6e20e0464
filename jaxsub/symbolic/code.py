"""C of a CasADi function: a file for a processor that has nothing else, and the same compiled and called from here."""

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi
import numpy as np

from ..errors import InputError

_FLAGS = ("-O1", "-fno-math-errno", "-shared", "-fPIC")
_POINTERS = ctypes.POINTER(ctypes.POINTER(ctypes.c_double))


def write_c(function: "casadi.Function", path: Path) -> None:
    """The function as C99 that needs `math.h` alone, and allocates nothing.

    It is called as `int NAME(const double** arg, double** res, long long* iw, double* w, int mem)`, where `arg` and
    `res` point to its arrays in and out, by columns, and `w` to the scratch memory whose size `NAME_work` tells.
    """
    generator = casadi.CodeGenerator(f"{function.name()}.c")
    generator.add(function)
    unfinished = path.with_name(path.name + ".part")
    unfinished.write_text(generator.dump(), encoding="utf-8")
    unfinished.replace(path)


class Native:
    """A CasADi function, compiled, on arrays that stay where they are: a call costs microseconds.

    **Fields**

    - `given`, `found`: the arrays in and out, flat and by columns, which the caller fills and reads.
    """

    def __init__(self, function: "casadi.Function", library: Path):
        self._library = ctypes.CDLL(str(library))
        self._call = self._library[function.name()]
        self._call.argtypes = [_POINTERS, _POINTERS, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]
        numbers = lambda count: np.zeros(max(int(count), 1))
        self.given = [numbers(function.nnz_in(i)) for i in range(function.n_in())]
        self.found = [numbers(function.nnz_out(i)) for i in range(function.n_out())]
        self._scratch = numbers(function.sz_w())
        self._whole = np.zeros(max(int(function.sz_iw()), 1), np.int64)
        self._arguments = (
            _pointers(self.given, function.sz_arg()),
            _pointers(self.found, function.sz_res()),
            self._whole.ctypes.data,
            self._scratch.ctypes.data,
            0,
        )

    def __call__(self) -> None:
        """`found` of `given`."""
        self._call(*self._arguments)


def _pointers(arrays: Sequence[np.ndarray], count: int) -> ctypes.Array:
    kind = ctypes.POINTER(ctypes.c_double)
    listed = [array.ctypes.data_as(kind) for array in arrays]
    return (kind * max(count, len(listed), 1))(*listed)


def compiled(function: "casadi.Function") -> Native:
    """The function compiled by the C compiler of this machine, `$CC` or `cc`.

    **Raises** `InputError` where there is none or it fails.
    """
    compiler = os.environ.get("CC", "cc")
    if shutil.which(compiler) is None:
        raise InputError(compiler, "no C compiler of this name", "install one, or name it in $CC")
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder) / f"{function.name()}.c", Path(folder) / f"{function.name()}.so"
        write_c(function, source)
        said = subprocess.run(
            [compiler, *_FLAGS, str(source), "-o", str(library), "-lm"], capture_output=True, text=True
        )
        if said.returncode:
            raise InputError(compiler, f"does not compile {source.name}: {said.stderr[:200]}", "try another in $CC")
        # it stays mapped when its file is gone
        return Native(function, library)
