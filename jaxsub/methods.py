"""Methods of modules that `jax.jit` takes as they are."""

import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from jax.tree_util import Partial

F = TypeVar("F", bound=Callable[..., Any])


class _Jittable:
    """A method that is bound as a `jax.tree_util.Partial`: a tree of its module's arrays, with an identity of its own.

    Equinox binds methods as modules, whose hash is that of their fields. Arrays have none, so that `jax.jit` refuses
    them.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        wrapper: Any = self
        functools.update_wrapper(wrapper, function)

    def __get__(self, module: Any, owner: type | None = None) -> Any:
        return self.function if module is None else Partial(self.function, module)


if TYPE_CHECKING:

    def jittable(method: F) -> F:
        """`method`, which a checker of types sees as it is."""
        return method

else:
    jittable = _Jittable
