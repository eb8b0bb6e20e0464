"""C that XLA's programs call: compiled once, kept beside JAX's own compiled programs."""

import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax

from ..errors import InputError

_FLAGS = ("-O2", "-ftree-vectorize", "-march=native", "-fno-math-errno", "-Wno-psabi", "-shared", "-fPIC")
# the vector forms of sin and its kin are in a library of their own, where there are any
_LIBRARIES = (("-lmvec", "-lm"), ("-lm",))
_held: list[ctypes.CDLL] = []


def foreign(source: str, names: Sequence[str]) -> dict[str, str]:
    """Compiles C whose functions `names` take an `XLA_FFI_CallFrame *`; by name, what `jax.ffi.ffi_call` calls each by.

    The library is kept in the folder of JAX's compilation cache, where the caller has set one.

    **Raises** `InputError` where there is no C compiler, `$CC` or `cc`, or it fails, and where JAX is not on a CPU.
    """
    if jax.default_backend() != "cpu":
        raise InputError("C", f"runs on a CPU, and JAX has picked {jax.default_backend()}", "set JAX_PLATFORMS=cpu")
    key = _key(source)
    _register(source, key, tuple(names))
    return {name: f"jaxsub_{name}_{key}" for name in names}


def _key(source: str) -> str:
    where = (platform.machine(), platform.node(), jax.__version__, _compiler(), *_FLAGS)
    return hashlib.sha256("\n".join((source, *where)).encode()).hexdigest()[:20]


def _compiler() -> str:
    return os.environ.get("CC", "cc")


@functools.cache
def _register(source: str, key: str, names: tuple[str, ...]) -> None:
    kept = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    with tempfile.TemporaryDirectory() as temporary:
        # a cache may be in a store that is no folder, such as gs://
        folder = Path(kept if kept and "://" not in kept else temporary)
        library = folder / f"jaxsub-{key}.so"
        if not library.exists():
            folder.mkdir(parents=True, exist_ok=True)
            _compile(source, library, Path(temporary))
        # it stays mapped when its file is gone
        loaded = ctypes.CDLL(str(library))
    for name in names:
        jax.ffi.register_ffi_target(f"jaxsub_{name}_{key}", jax.ffi.pycapsule(loaded[name]), platform="cpu")
    _held.append(loaded)


def _compile(source: str, library: Path, folder: Path) -> None:
    compiler = _compiler()
    if shutil.which(compiler) is None:
        raise InputError(compiler, "no C compiler of this name", "install one, or name it in $CC")
    written, made = folder / "source.c", folder / library.name
    written.write_text(source, encoding="utf-8")
    run: Callable[..., Any] = lambda last: subprocess.run(
        [compiler, *_FLAGS, f"-I{jax.ffi.include_dir()}", str(written), "-o", str(made), *last],
        capture_output=True,
        text=True,
    )
    for last in _LIBRARIES:
        said = run(last)
        if said.returncode == 0:
            # beside where it goes first, so that no one ever sees a part of it
            unfinished = library.with_name(f"{library.name}.{os.getpid()}")
            shutil.copyfile(made, unfinished)
            unfinished.replace(library)
            return
    raise InputError(compiler, f"does not compile a march: {said.stderr[:300]}", "try another in $CC")
