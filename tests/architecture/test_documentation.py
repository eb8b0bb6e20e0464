"""Public docstrings name every argument, rooms export and define nothing, and no text is in the old dialect."""

import ast
import dataclasses
import functools
import importlib
import inspect
import json
import pkgutil
import re
from pathlib import Path

import equinox as eqx
import pytest
from jaxtyping import Array, Float

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


# what says how large a number is: a unit, or a word for what has none
UNIT = re.compile(
    r"(?<![\w`])√?(?:m|s|rad|N|N m|kg|SI|m/s²?|rad/s²?|kg/m³|rad/s/√Hz|m/s²/√Hz)(?![\w`/])"
    r"|\b(units?|coordinates|whitened|relative|scaled|parts of|standard errors?|Jacobian|samples|key)\b"
    r"|\b(how (many|often)|without a unit|unit length|σ|standard deviations)\b"
)


def array_fields(kind):
    """Arrays that a class itself has as public fields, but an effect's numbers, which carry their unit in the code."""
    own = vars(kind).get("__annotations__", {})
    for field in dataclasses.fields(kind):
        public = field.name in own and not field.name.startswith("_") and "unit" not in field.metadata
        if public and re.search(r"\bArray\b|ndarray|(Float|Int|Bool)\[", str(field.type)):
            yield field


def shape_of(annotation):
    """The named axes of an annotation of `jaxtyping`, without leading ones of any number."""
    inner = (annotation, *getattr(annotation, "__args__", ()))
    axes = next((one.dim_str.split() for one in inner if hasattr(one, "dim_str")), [])
    return [axis for axis in axes if not axis.startswith("*")]


def described(text, name):
    """What the fields of a docstring say of one of them; None where they do not."""
    until = r"(?=\n\s*-|\n\n|[.;,] (?:and )?`\w+`(?:, `\w+`)*:|\Z)"
    found = re.search(rf"`{name}`(?:, `\w+`)*:(.*?){until}", text, re.DOTALL)
    return found and found[1]


def unstated(kind):
    """Array fields of a class of which its docstring, or that of a base, lacks shape or unit."""
    text = "\n".join(inspect.cleandoc(base.__doc__ or "") for base in kind.__mro__ if base not in (eqx.Module, object))
    for field in array_fields(kind):
        said = described(text, field.name)
        if said is None:
            yield f"{kind.__name__}.{field.name}: not described"
        elif shape_of(field.type) and not re.search(r"\([^()]*,[^()]*\)", said):
            yield f"{kind.__name__}.{field.name}: no shape {shape_of(field.type)} in: {said}"
        elif "Float[" in str(field.type) and not UNIT.search(re.sub(r"\([^()]*,[^()]*\)", "", said, count=1)):
            yield f"{kind.__name__}.{field.name}: no unit in: {said}"


@pytest.mark.parametrize("room", ROOMS)
def test_docstrings_state_shape_and_unit_of_every_array_field(room):
    """Claim: of each public dataclass and module of equinox, so that a reader need not look up who fills the field."""
    module = importlib.import_module(room)
    public = [getattr(module, name) for name in getattr(module, "__all__", ())]
    kinds = [kind for kind in public if inspect.isclass(kind) and dataclasses.is_dataclass(kind)]
    assert [fault for kind in kinds for fault in unstated(kind)] == []


def test_an_array_field_without_shape_or_unit_is_seen():
    class Known(eqx.Module):
        """Two.

        **Fields**

        - `good`: (c,) m/s. `flat`: m. `bare`: (c,) what is left.
        """

        good: Float[Array, " c"]
        flat: Float[Array, " c"]
        bare: Float[Array, " c"]
        absent: Float[Array, ""]

    faults = [fault.partition(" in:")[0] for fault in unstated(Known)]
    assert faults == ["Known.flat: no shape ['c']", "Known.bare: no unit", "Known.absent: not described"]


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
