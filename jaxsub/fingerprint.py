"""A digest of what a traced program depends on besides the values of its arrays: equal digests mean equal programs.

Programs are kept between processes by it, so that nothing is guessed: a kind of object that this file does not know has
no digest, nor has code that is neither jaxsub's nor of a library whose version is in the digest.
"""

import dataclasses
import enum
import functools
import hashlib
import platform
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jax.core import Tracer

# whose objects a program may hold: their versions are in the digest
_LIBRARIES = ("diffrax", "equinox", "jax", "jaxlib", "jaxtyping", "lineax", "numpy", "optax", "optimistix")
_STANDARD = ("builtins", "collections", "enum", "functools", "math", "operator", "types", "typing")
_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.dtype)


class NoDigestError(TypeError):
    """An object of a kind that may stand for more than its digest could say."""


def digest(function: Callable, arguments: Any) -> str:
    """A digest of the program of `function` at `arguments`, of whose arrays only shapes and kinds count.

    **Raises** `NoDigestError` where there is none.
    """
    settings = repr(sorted(jax.config.values.items()))
    parts = (surroundings(), settings, _Walk().of(function, True), _Walk().of(arguments, False))
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@functools.cache
def surroundings() -> str:
    """A digest of what every program depends on: jaxsub's sources, what is installed, the kind of device."""
    parts = [sources(), *_installed(), sys.version, platform.machine(), jax.default_backend()]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@functools.cache
def sources() -> str:
    """A digest of jaxsub's sources."""
    found, folder = hashlib.sha256(), Path(__file__).parent
    for path in sorted(folder.rglob("*.py")):
        found.update(f"{path.relative_to(folder)}\n".encode() + path.read_bytes())
    return found.hexdigest()


def _installed() -> list[str]:
    """Names and versions of installed packages, as their folders have them: any may be called in a traced function."""
    found = {path.name for place in map(Path, sys.path) if place.is_dir() for path in place.glob("*.dist-info")}
    return sorted(found)


class _Walk:
    """Digests of the parts of one object; a part that stands in many places is looked at once."""

    def __init__(self) -> None:
        # the parts are kept beside their digests, since the identity of one that is gone may be another's
        self._seen: dict[tuple[int, bool], tuple[Any, str]] = {}

    def of(self, what: Any, fixed: bool) -> str:
        """The digest of `what`; where it is `fixed` the values of arrays count too."""
        key = id(what), fixed
        if key not in self._seen:
            self._seen[key] = what, ""
            parts = [type(what).__qualname__, *self._parts(what, fixed)]
            self._seen[key] = what, hashlib.sha256("\n".join(parts).encode()).hexdigest()
        if not self._seen[key][1]:
            raise NoDigestError(f"{type(what).__qualname__} holds itself")
        return self._seen[key][1]

    def _parts(self, what: Any, fixed: bool) -> Iterator[str]:
        """Texts of `what`: its values, or digests of its parts."""
        if isinstance(what, enum.Enum):
            yield from (_reference(type(what)), what.name)
        elif isinstance(what, _PLAIN):
            yield repr(what)
        elif eqx.is_array(what):
            yield from _array(what, fixed)
        elif isinstance(what, type):
            yield _reference(what)
        elif isinstance(what, tuple | list):
            yield _reference(type(what))
            yield from (self.of(part, fixed) for part in what)
        elif isinstance(what, dict | types.MappingProxyType):
            yield from (self.of(part, fixed) for item in what.items() for part in item)
        elif isinstance(what, set | frozenset):
            yield from sorted(self.of(part, fixed) for part in what)
        elif dataclasses.is_dataclass(what):
            yield from self._fields(what, fixed)
        else:
            yield from self._code(what)

    def _fields(self, what: Any, fixed: bool) -> Iterator[str]:
        yield _reference(type(what))
        # other data classes are leaves to JAX, whatever they hold
        fixed = fixed or not isinstance(what, eqx.Module)
        for field in dataclasses.fields(what):
            if hasattr(what, field.name):
                yield self.of(getattr(what, field.name), fixed or field.metadata.get("static", False))

    def _code(self, what: Any) -> Iterator[str]:
        """Of functions: by name where that leads to it, else its code and all that it holds."""
        if isinstance(what, functools.partial):
            yield from (self.of(part, True) for part in (what.func, what.args, what.keywords))
        elif isinstance(what, types.MethodType):
            yield from (self.of(what.__self__, True), self.of(what.__func__, True))
        elif isinstance(what, types.FunctionType) and "<" in what.__qualname__:
            yield from (_trusted(what.__module__), _place(what))
            held = [cell.cell_contents for cell in what.__closure__ or ()]
            yield from (self.of(part, True) for part in (held, what.__defaults__, what.__kwdefaults__))
        else:
            yield _reference(what)


def _array(what: Any, fixed: bool) -> Iterator[str]:
    """Shape and kind of an array, and its values where they count."""
    if isinstance(what, Tracer):
        raise NoDigestError("a traced value")
    yield f"{what.shape} {what.dtype} {getattr(what, 'weak_type', False)}"
    if fixed:
        yield np.asarray(what).tobytes().hex()


def _place(function: types.FunctionType) -> str:
    """Where in its module's source a function stands. **Raises** `NoDigestError` where it was made otherwise."""
    code = function.__code__
    if code.co_filename != getattr(sys.modules.get(function.__module__), "__file__", None):
        raise NoDigestError(f"{function.__qualname__} is not in the source of {function.__module__}")
    return f"{function.__qualname__} {list(code.co_positions())}"


def _reference(what: Any) -> str:
    """The name that leads to `what`. **Raises** `NoDigestError` where none does."""
    module, name = getattr(what, "__module__", None), getattr(what, "__qualname__", None)
    if isinstance(module, str) and isinstance(name, str):
        found: Any = sys.modules.get(_trusted(module))
        for part in name.split("."):
            found = getattr(found, part, None)
        if found is what or getattr(found, "__wrapped__", None) is what:
            return f"{module}.{name}"
    raise NoDigestError(f"{type(what).__qualname__} {name or ''} has no name that leads to it")


def _trusted(module: str) -> str:
    """The module. **Raises** `NoDigestError` where no digest stands for its source."""
    if module.split(".")[0] in (*_LIBRARIES, *_STANDARD, __name__.split(".")[0]):
        return module
    raise NoDigestError(f"{module} is not part of the digest")
