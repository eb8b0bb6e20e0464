"""The checker that the import hook of conftest.py puts around every function of jaxsub."""

from collections.abc import Callable
from typing import Any, TypeVar

from beartype import beartype

F = TypeVar("F", bound=Callable[..., Any])


def checked(function: F) -> F:
    """beartype without `Self`, which it resolves only where it decorates whole classes; jaxtyping does functions."""
    hints = getattr(function, "__annotations__", {})
    function.__annotations__ = {name: hint for name, hint in hints.items() if "Self" not in str(hint)}
    return beartype(function)
