"""Programs that are traced once: kept on disk, a later process need not trace and lower them again.

JAX keeps what XLA makes of a program, but to find it there a process traces and lowers the program anew, which takes
most of the time of a short command. Here the lowered program itself is kept, by a digest of all that it depends on.
"""

import dataclasses
import functools
import hashlib
import os
import pickle
import types
import uuid
from collections.abc import Callable, Hashable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import numpy as np
from jax import export
from jax.core import Tracer

from .fingerprint import NoDigestError, digest

F = TypeVar("F", bound=Callable)
R = TypeVar("R")

# what takes the arrays of a call and returns what the function returns
_Call = Callable[[Sequence[Any]], Any]


class _Kept:
    """Where this process keeps its programs: nowhere until a command says so."""

    folder: Path | None = None


def keep_programs(folder: Path | None) -> None:
    """From now on keep this process's programs in `folder`, which must be there; or nowhere."""
    _Kept.folder = folder


def kept_programs() -> Path | None:
    """The folder of `keep_programs`."""
    return _Kept.folder


def compiled(function: F) -> F:
    """The function as `equinox.filter_jit` makes it; its programs are kept where `keep_programs` says.

    Within a trace, on several devices, and where no digest can be given, it is `equinox.filter_jit` itself.
    """
    return cast(F, _Compiled(function))


class _Compiled:
    """A function and its programs, by what they depend on; None for those that are not kept."""

    def __init__(self, function: Callable):
        functools.update_wrapper(self, function)
        self._function, self._jitted = function, eqx.filter_jit(function)
        self._calls: dict[Hashable, _Call | None] = {}

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        if _Kept.folder is None or jax.local_device_count() > 1:
            return self._jitted(*args, **kwargs)
        leaves, structure = jax.tree.flatten((args, kwargs))
        arrays = [leaf for leaf in leaves if eqx.is_array(leaf)]
        if _traced(arrays):
            return self._jitted(*args, **kwargs)
        key = structure, tuple(map(_kind, leaves))
        if key not in self._calls:
            self._calls[key] = _kept(_Kept.folder, self._function, args, kwargs)
        call = self._calls[key]
        return self._jitted(*args, **kwargs) if call is None else call(arrays)

    def __reduce__(self) -> str:
        # by its name, as any function
        return self._function.__qualname__

    def lower(self, *args: Any, **kwargs: Any) -> Any:
        """The lowered program, as by `equinox.filter_jit`; it is not kept."""
        return self._jitted.lower(*args, **kwargs)

    def __get__(self, instance: Any, owner: Any) -> Any:
        return self if instance is None else types.MethodType(self, instance)


@dataclasses.dataclass(frozen=True)
class _Place:
    """Where in a result an array belongs."""

    index: int


def _is_place(part: Any) -> bool:
    return isinstance(part, _Place)


# a constant, which is traced where everything is; compiled, since it is asked at every call
_constant = jax.jit(lambda: 0.0)


def _traced(arrays: Sequence[Any]) -> bool:
    """Whether any of `arrays` is being traced, or everything is."""
    return any(isinstance(value, Tracer) for value in (*arrays, _constant()))


def _kind(leaf: Any) -> Hashable:
    """What a program depends on of a leaf: of an array its shape and kind of numbers, else the leaf itself."""
    return (leaf.shape, leaf.dtype, getattr(leaf, "weak_type", False)) if eqx.is_array(leaf) else leaf


def _kept(folder: Path, function: Callable, args: Any, kwargs: Any) -> _Call | None:
    """The program for such arguments, read from `folder` or else made and kept there; None where it cannot be kept."""
    try:
        path = folder / f"{function.__name__}-{digest(function, (args, kwargs))}"
        program, result = _read(path) or _made(path, function, args, kwargs)
    except (NoDigestError, NotImplementedError, ValueError):
        # of `jax.export` the last two; what is wrong with the arguments is said when the function itself is called
        return None
    run = lambda *arrays: program.call(*arrays)
    run.__name__ = function.__name__
    # what such a program returns is bound to its device: without `in_shardings` it would be compiled again for that
    compiled = jax.jit(run, in_shardings=jax.sharding.SingleDeviceSharding(jax.devices()[0]))
    parts, built = jax.tree.flatten(result, is_leaf=_is_place)
    filled = lambda arrays: [arrays[part.index] if _is_place(part) else part for part in parts]
    return lambda arrays: jax.tree.unflatten(built, filled(compiled(*arrays)))


def _made(path: Path, function: Callable, args: Any, kwargs: Any) -> tuple[export.Exported, Any]:
    """The program traced and lowered, and its result with places for arrays; both are kept at `path`."""
    leaves, structure = jax.tree.flatten((args, kwargs))
    results = []

    def flat(*arrays: Any) -> list[Any]:
        given = iter(arrays)
        args, kwargs = jax.tree.unflatten(structure, [next(given) if eqx.is_array(leaf) else leaf for leaf in leaves])
        parts, built = jax.tree.flatten(function(*args, **kwargs))
        found = [part for part in parts if eqx.is_array(part)]
        places = iter(range(len(found)))
        results.append(jax.tree.unflatten(built, [_Place(next(places)) if eqx.is_array(p) else p for p in parts]))
        return found

    flat.__name__ = function.__name__
    program = export.export(jax.jit(flat))(*(leaf for leaf in leaves if eqx.is_array(leaf)))
    try:
        content = pickle.dumps((bytes(program.serialize()), results[-1]))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise NoDigestError(f"{function.__name__}: its result cannot be kept: {error}") from error
    with suppress(OSError):
        scratch = path.with_name(f"{path.name}.{uuid.uuid4().hex}")
        scratch.write_bytes(hashlib.sha256(content).digest() + content)
        os.replace(scratch, path)
    return program, results[-1]


def _read(path: Path) -> tuple[export.Exported, Any] | None:
    """What `_made` has kept at `path`; None where there is nothing, or it is damaged.

    Unpickling may run code, as may the machine code that JAX keeps beside it: whoever may write to the user's cache may
    run programs as the user.
    """
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        return None
    program, result = pickle.loads(content[32:])
    _load_lapack()
    return export.deserialize(bytearray(program)), result


@functools.cache
def _load_lapack() -> None:
    """Let JAX find LAPACK, which JAX before 0.10 does only when it lowers a program: one read from disk would crash.

    https://github.com/jax-ml/jax/issues/29610
    """
    jax.jit(jax.lax.linalg.cholesky).lower(np.eye(1))


def cores() -> int:
    """The cores that this process may run on: in a batch job or a container fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def on_cores(
    function: Callable[..., R], arguments: Sequence[tuple], threads: int | None = None, ready: bool = False
) -> list[R]:
    """`function` of each of the `arguments`, on so many `threads`, by default as many as there are cores.

    Of the first by itself, unless the function is `ready` compiled: threads that trace the same program at once can
    crash JAX.
    """
    alone = 0 if ready else 1
    found = [function(*own) for own in arguments[:alone]]
    if not (rest := arguments[alone:]):
        return found
    with ThreadPoolExecutor(min(threads or cores(), len(rest))) as pool:
        return found + list(pool.map(lambda own: function(*own), rest))
