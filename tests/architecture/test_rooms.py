"""Rooms import only rooms to their left, files stay short, and importing any of them has no side effect."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import jaxsub

HOUSE = Path(jaxsub.__file__).parent
FILES = sorted(HOUSE.rglob("*.py"))
# lowest first; effects come before vehicle, which has them built in
ORDER = (
    "errors", "findings", "plain", "fingerprint", "programs", "workers", "storage", "unit_names", "units", "arrays",
    "methods", "parameters", "results", "symbolic", "recording", "effects", "sensors", "vehicle", "simulation",
    "filter", "navigation", "likelihood", "estimate", "information", "checks", "discrepancy", "monitoring", "control",
    "sweeps", "report", "api", "cli", "__main__",
)  # fmt: skip
# of the room of diagnosis, lowest first
STEPS = ("settings", "programs", "records", "linearise", "propose", "accept", "search", "explain", "procedure")


def room(path):
    """The room that a file is in, or is."""
    return path.relative_to(HOUSE).parts[0].removesuffix(".py")


def imported(path, tree, within="jaxsub"):
    """The rooms that a file imports, or parts of one, by absolute and relative imports, wherever in it they stand."""
    package = ("jaxsub", *path.relative_to(HOUSE).parts[:-1])
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = list(package[: len(package) + 1 - node.level]) if node.level else []
            base += node.module.split(".") if node.module else []
            names = [[*base, alias.name] for alias in node.names]
        else:
            continue
        depth = within.count(".") + 1
        yield from (name[depth] for name in names if name[:depth] == within.split(".") and len(name) > depth)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_file_imports_only_rooms_to_its_left(path):
    if path == HOUSE / "__init__.py":
        pytest.skip("the house itself")
    here = room(path)
    assert here in ORDER, f"{here} is a new room: give it a place in ORDER"
    for other in imported(path, ast.parse(path.read_text(encoding="utf-8"))):
        assert other in ORDER, f"imports {other}, which is no room"
        assert ORDER.index(other) <= ORDER.index(here), f"{here} imports {other}"


@pytest.mark.parametrize(
    "path", [path for path in FILES if path.parent.parent == HOUSE / "discrepancy"], ids=lambda p: p.stem
)
def test_steps_of_a_diagnosis_import_only_earlier_ones(path):
    """Claim: what proposes does not know what accepts, nor either of them what explains the answer."""
    for other in imported(path, ast.parse(path.read_text(encoding="utf-8")), "jaxsub.discrepancy"):
        assert STEPS.index(other) <= STEPS.index(path.parent.name), f"imports {other}"


def test_every_part_of_the_room_of_diagnosis_is_a_step():
    """Claim: no module stands beside the steps, in the order of which they import each other."""
    assert {path.name.removesuffix(".py") for path in (HOUSE / "discrepancy").iterdir()} - {"__pycache__"} == {
        *STEPS, "__init__",
    }  # fmt: skip


def test_the_reader_of_imports_sees_every_form():
    absolute, relative = (
        "import jaxsub.cli\nfrom jaxsub import report\n",
        "from ..vehicle.base import x\nfrom .. import units\n",
    )
    source = ast.parse(absolute + relative + "from .a import b")
    found = list(imported(HOUSE / "effects" / "hull.py", source))
    assert found == ["cli", "report", "vehicle", "units", "effects"]


def bound(tree):
    """The names that the top of a module imports, defines or assigns, but for modules of its own package."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (alias.asname or alias.name for alias in node.names)
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (target.id for target in node.targets if isinstance(target, ast.Name))


PACKAGES = [path for path in FILES if path.name == "__init__.py"]


@pytest.mark.parametrize("path", PACKAGES, ids=lambda path: str(path.parent.relative_to(HOUSE)))
def test_package_hides_none_of_its_modules(path):
    """Claim: no name of a package is that of one of its modules, which could then not be reached as an attribute."""
    modules = {file.stem for file in path.parent.glob("*.py")} | {
        file.parent.name for file in path.parent.glob("*/*.py")
    }
    names = set(bound(ast.parse(path.read_text(encoding="utf-8"))))
    assert names.isdisjoint(modules)


def test_no_public_name_has_two_meanings():
    """Claim: no two rooms offer different things under one name; the front door's functions call those of rooms."""
    offered: dict[str, list[str]] = {}
    for path in PACKAGES:
        if path.parent.parent == HOUSE and room(path) not in ("api", "cli"):
            for name in bound(ast.parse(path.read_text(encoding="utf-8"))):
                offered.setdefault(name, []).append(room(path))
    assert {name: rooms for name, rooms in offered.items() if len(rooms) > 1 and name != "__all__"} == {}


def test_the_reader_of_names_sees_every_form():
    source = "from .fit import fit, Fit as F\nfrom . import plain\ndef f(): ...\nclass C: ...\nx = 1\nimport os\n"
    assert list(bound(ast.parse(source))) == ["fit", "F", "f", "C", "x"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_file_is_short_and_says_what_it_is_for(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 400
    assert ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(HOUSE)))
def test_a_function_that_is_compiled_keeps_its_programs(path):
    """Claim: functions are compiled by `programs.compiled`, so that a later process need not trace them."""
    decorators = [d for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) for d in _decorators(node)]
    assert not [one for one in decorators if "filter_jit" in one]


def _decorators(node):
    return [ast.unparse(decorator) for decorator in getattr(node, "decorator_list", [])]


def test_importing_every_module_prints_nothing_changes_no_setting_and_starts_no_backend():
    modules = sorted(
        ".".join(("jaxsub", *path.relative_to(HOUSE).with_suffix("").parts)).removesuffix(".__init__")
        for path in FILES
        if path.stem != "__main__"
    )
    script = f"""
import importlib, warnings
warnings.simplefilter("error")
import jax, matplotlib, numpy
before = jax.config.jax_enable_x64, dict(matplotlib.rcParams), numpy.random.get_state()[1].tolist(), numpy.geterr()
for name in {modules!r}:
    importlib.import_module(name)
after = jax.config.jax_enable_x64, dict(matplotlib.rcParams), numpy.random.get_state()[1].tolist(), numpy.geterr()
assert before == after
# JAX refuses this once a backend has started, and a command's options of XLA have no effect after that
jax.config.update("jax_num_cpu_devices", 2)
assert len(jax.devices("cpu")) == 2
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=HOUSE.parent, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
