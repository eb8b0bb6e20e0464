"""C that XLA's programs call: compiled once, kept beside JAX's own compiled programs.

A kept library is named after what it was made of, the processor's features included, and after its own digest: homes
are shared between machines, and a damaged file that is loaded ends the process in a bus error.
"""

import contextlib
import ctypes
import functools
import hashlib
import os
import platform
import shutil
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import jax

from ..errors import InputError
from .compiler import compile_library, compiler, target

_FLAGS = ("-O2", "-ftree-vectorize", "-march=native", "-fno-math-errno", "-Wno-psabi", "-shared", "-fPIC")
# the vector forms of sin and its kin are in a library of their own, where there are any
_LIBRARIES = (("-lmvec", "-lm"), ("-lm",))
_held: dict[str, ctypes.CDLL] = {}
# JAX refuses a second registration of one name
_registering = threading.Lock()


def foreign(source: str, names: Sequence[str]) -> dict[str, str]:
    """Compiles C whose functions `names` take an `XLA_FFI_CallFrame *`; by name, what `jax.ffi.ffi_call` calls each by.

    The library is kept in the folder of JAX's compilation cache, where the caller has set one that can be written.

    **Raises** `InputError` where there is no C compiler, `$CC` or `cc`, or it fails, and where JAX is not on a CPU.
    """
    if jax.default_backend() != "cpu":
        raise InputError("C", f"runs on a CPU, and JAX has picked {jax.default_backend()}", "set JAX_PLATFORMS=cpu")
    key = _key(source)
    with _registering:
        if key not in _held:
            loaded = _library(source, key)
            for name in names:
                jax.ffi.register_ffi_target(f"jaxsub_{name}_{key}", jax.ffi.pycapsule(loaded[name]), platform="cpu")
            _held[key] = loaded
    return {name: f"jaxsub_{name}_{key}" for name in names}


def _key(source: str) -> str:
    command = tuple(compiler())
    where = (platform.system(), platform.machine(), jax.__version__, *command, *_FLAGS, _target(command))
    return hashlib.sha256("\n".join((source, *where)).encode()).hexdigest()[:20]


@functools.cache
def _target(command: tuple[str, ...]) -> str:
    """The target of the compiler `command`, which is asked once a process."""
    return target(_FLAGS)


def _library(source: str, key: str) -> ctypes.CDLL:
    """The library of `source`: one that is kept, or one compiled now, and kept where that can be done."""
    kept = _kept()
    for found in _sound(kept, key) if kept else ():
        try:
            return ctypes.CDLL(str(found))
        except OSError:  # such as on a file system whose files may not be executed
            continue
    with tempfile.TemporaryDirectory() as temporary:
        made = Path(temporary) / f"jaxsub-{key}.so"
        compile_library(source, made, (*_FLAGS, f"-I{jax.ffi.include_dir()}"), _LIBRARIES)
        failed: OSError | None = None
        # it stays mapped when its file is gone
        for library in (_keep(made, kept, key), made):
            try:
                if library is not None:
                    return ctypes.CDLL(str(library))
            except OSError as error:
                failed = error
    raise InputError(str(made), f"cannot be loaded: {failed}", "set TMPDIR to a folder whose files may be executed")


def _kept() -> Path | None:
    """The folder of JAX's cache; None where there is none, or it is in a store that is no folder, such as gs://."""
    kept = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    return Path(kept) if kept and "://" not in kept else None


def _sound(folder: Path, key: str) -> list[Path]:
    """The kept libraries of `key` that are as they were written; those that are damaged are removed."""
    sound = []
    for library in sorted(folder.glob(f"jaxsub-{key}-*.so")):
        try:
            if library.name == _name(library, key):
                sound.append(library)
            else:
                library.unlink()
        except OSError:  # another process has removed it, or it may not be read or removed
            continue
    return sound


def _name(library: Path, key: str) -> str:
    return f"jaxsub-{key}-{hashlib.sha256(library.read_bytes()).hexdigest()[:20]}.so"


def _keep(made: Path, folder: Path | None, key: str) -> Path | None:
    """Where the library has been kept; None where that cannot be done, as in a folder that cannot be written."""
    if folder is None:
        return None
    library = folder / _name(made, key)
    unfinished = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _tidy(folder)
        # beside where it goes first, so that no one ever sees a part of it
        with tempfile.NamedTemporaryFile(dir=folder, prefix="jaxsub-", suffix=".part", delete=False) as file:
            unfinished = Path(file.name)
            file.write(made.read_bytes())
            file.flush()
            os.fsync(file.fileno())
        shutil.copymode(made, unfinished)
        unfinished.replace(library)
    except OSError:  # read-only, or full
        if unfinished is not None:
            unfinished.unlink(missing_ok=True)
        return None
    return library


def _tidy(folder: Path) -> None:
    """Remove what writers that were ended left behind; none writes for an hour."""
    for left in folder.glob("jaxsub-*.part"):
        with contextlib.suppress(OSError):
            if time.time() - left.stat().st_mtime > 3600.0:
                left.unlink()
