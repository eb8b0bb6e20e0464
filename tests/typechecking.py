"""An import hook for the tests: each call of a function of jaxsub is checked against its annotations.

jaxtyping's own hook binds the arguments and checks them twice at every call, of functions without shapes too, which
is a tenth of the suite's time. Here beartype checks the function itself, and axes by the same name have the same
length only within functions that annotate a shape.
"""

import ast
import dataclasses
import functools
import sys
from collections.abc import Callable
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from types import CodeType, ModuleType
from typing import Any, get_args

from beartype import beartype
from jaxtyping import jaxtyped


def install(package: str) -> None:
    """Check whatever is imported of `package` from now on."""
    sys.meta_path.insert(0, _Finder(package))


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function`, with a check of arguments and of what it returns where these are annotated."""
    hints = {name: _resolved(hint, function) for name, hint in getattr(function, "__annotations__", {}).items()}
    # beartype resolves `Self` only where it decorates whole classes
    function.__annotations__ = {name: hint for name, hint in hints.items() if "Self" not in str(hint)}
    within = beartype(function)
    if not any(map(_has_shape, hints.values())):
        return within

    @functools.wraps(function)
    def called(*args: Any, **kwargs: Any) -> Any:
        with jaxtyped("context"):
            return within(*args, **kwargs)

    return called


def checked_class(cls: type) -> type:
    """`cls`, with a check of the values of its fields where it is a dataclass."""
    if dataclasses.is_dataclass(cls) and "__init__" in vars(cls) and not hasattr(cls.__init__, "__wrapped__"):
        cls.__init__ = checked(cls.__init__)
    return cls


def _resolved(hint: Any, function: Callable[..., Any]) -> Any:
    """What an annotation in quotes stands for; anything, where its name is imported for type checkers alone."""
    if not isinstance(hint, str):
        return hint
    try:
        return eval(hint, function.__globals__)
    except NameError:
        return Any


def _has_shape(hint: Any) -> bool:
    return getattr(hint, "__module__", None) == "jaxtyping" or any(map(_has_shape, get_args(hint)))


class _Decorated(ast.NodeTransformer):
    """Every function and class of a module under its checker, which is the innermost decorator of a function."""

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.decorator_list.append(ast.copy_location(ast.Name("__checked__", ast.Load()), node))
        return self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        node.decorator_list.insert(0, ast.copy_location(ast.Name("__checked_class__", ast.Load()), node))
        return self.generic_visit(node)


class _Loader(SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        # always from the source, since what is kept in __pycache__ has no checks
        path = self.get_filename(fullname)
        return compile(_Decorated().visit(ast.parse(self.get_data(path), path)), path, "exec", dont_inherit=True)

    def exec_module(self, module: ModuleType) -> None:
        vars(module).update(__checked__=checked, __checked_class__=checked_class)
        super().exec_module(module)


class _Finder(MetaPathFinder):
    def __init__(self, package: str):
        self.package = package

    def find_spec(self, fullname: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        if fullname.partition(".")[0] != self.package:
            return None
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and isinstance(spec.loader, SourceFileLoader):
            spec.loader = _Loader(spec.loader.name, spec.loader.path)
        return spec
