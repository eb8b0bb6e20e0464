"""Public docstrings name every argument, rooms export and define nothing, and no text is in the old dialect."""

import ast
import functools
import importlib
import inspect
import json
import pkgutil
import re
from pathlib import Path

import pytest

import jaxsub

ROOT = Path(__file__).parents[2]
ROOMS = ["jaxsub", *(f"jaxsub.{room.name}" for room in pkgutil.iter_modules(jaxsub.__path__) if room.ispkg)]
# phrases that mean nothing in plain English or the field, and what is written instead
DIALECT = {
    r"free runs?\b": "open-loop simulation",
    r"what comes next": "one-step-ahead prediction",
    r"begun anew in pieces": "multi-step prediction",
    r"led along": "filtered along",
    r"how much it says": "log evidence",
    r"(force|mismatch)s? without a name": "nonparametric force",
    r"trades? with": "correlated estimates",
    r"how far from zero": "prior standard deviation",
    r"comes? and goes?\b": "Gauss–Markov disturbance force",
    r"names beside each other": "posterior over structures",
    r"\b(is|was|by|of|mere) luck\b": "p-value",
    r"\btwins\b": "nearly collinear candidates",
    r"\b(is|are) asked for in\b": "candidate",
}


def arguments(function):
    """Names of a function's arguments but for the object that it belongs to."""
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def methods(kind):
    """Public methods that a class defines, each with its name and with what the class's bases say of it."""
    for name, found in vars(kind).items():
        function = found.__func__ if isinstance(found, classmethod | staticmethod) else found
        if inspect.isfunction(function) and not name.startswith("_"):
            yield (
                name,
                function,
                " ".join(getattr(base, name).__doc__ or "" for base in kind.__mro__ if hasattr(base, name)),
            )


def unnamed(room):
    """Arguments that the docstring of a public function or method of a room does not name."""
    module = importlib.import_module(room)
    for name in getattr(module, "__all__", ()):
        one = getattr(module, name)
        if inspect.isclass(one):
            members = methods(one)
        else:
            function = inspect.unwrap(one) if callable(one) else None
            members = [("", function, one.__doc__ or "")] if inspect.isfunction(function) else []
        for member, function, text in members:
            for argument in arguments(function):
                if not re.search(rf"(?<!\w){re.escape(argument)}(?!\w)", text):
                    yield f"{name}.{member}".rstrip(".") + f": {argument}"


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_name_every_argument(room):
    assert list(unnamed(room)) == []


def test_an_argument_that_is_not_named_is_seen():
    def f(known, missing):
        """Of `known`."""

    assert [name for name in arguments(f) if name not in (f.__doc__ or "")] == ["missing"]


@pytest.mark.parametrize("room", ROOMS[1:])
def test_rooms_export_and_define_nothing(room):
    """Claim: the `__init__` of a room has imports and `__all__`, and at most imports its names at their first use."""
    tree = ast.parse(inspect.getsource(importlib.import_module(room)))
    defined = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert defined <= {"__getattr__", "__dir__"}


@functools.cache
def texts():
    """Everything that a reader reads: code, guides, lessons and pages of experiments."""
    ends = {"jaxsub": ("py", "j2", "js"), "notebooks": ("md", "py"), "experiments": ("py", "md")}
    paths = [path for folder, kinds in ends.items() for end in kinds for path in (ROOT / folder).rglob(f"*.{end}")]
    found = {path: path.read_text(encoding="utf-8") for path in (*paths, ROOT / "README.md", ROOT / "CONTRIBUTING.md")}
    for path in (ROOT / "notebooks").glob("*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        found[path] = "\n".join("".join(cell["source"]) for cell in cells)
    return found


@pytest.mark.parametrize(("phrase", "instead"), DIALECT.items())
def test_no_text_is_in_the_old_dialect(phrase, instead):
    pattern = re.compile(phrase, re.IGNORECASE)
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}" for path, text in texts().items() for match in pattern.finditer(text)
    ]
    assert found == [], f"write {instead}"
