"""Every number that a diagnosis decides by, and no other, stands in `discrepancy/settings.py`, named, and is used."""

import ast
from pathlib import Path

import pytest

import jaxsub.discrepancy

ROOM = Path(jaxsub.discrepancy.__file__).parent
FILES = sorted(path for path in ROOM.rglob("*.py") if path.name != "settings.py")
SETTINGS = ast.parse((ROOM / "settings.py").read_text(encoding="utf-8"))

# numbers that no decision depends on, by why
ALLOWED = {
    "bounds a rounding error, or the condition of a matrix": {
        "nonparametric.py": {"_ROUNDING"}, "spline_basis.py": {"STILL"}, "innovation_search.py": {"_UNIDENTIFIED"},
        "model.py": {"_NO_COLUMN", "_VANISHED"}, "evidence.py": {"_STILL"},
        "rivals.py": {"_TINY"}, "smoothness.py": {"_ROUNDING"}, "validation.py": {"_STILL"},
    },
    "is where a search for an optimum begins, how it is damped, or when it ends": {
        "innovation_search.py": {
            "_DAMPINGS", "_SHARES", "_SMALL", "_ALTERNATIONS", "_CONVERGED", "_STEPS", "_LEAST_GAIN",
            "_NEGLIGIBLE_GAIN",
        },
        "tuned.py": {"_NEAR", "_STEPS"},
        "view.py": {"_DOUBTED", "_QUIET", "_LEAST_WHITE"},
    },
    "is the resolution of a grid, a difference or a random test": {
        "columns.py": {"_NUDGE", "_SMALL", "_AT_ONCE"}, "spline_basis.py": {"_CHOOSING"},
        "consistency.py": {"_DRAWS", "_SEED"}, "multiplicity.py": {"_DRAWS", "_SEED"},
        "run_effect.py": {"_LEAST", "_TRIED"},
        "smoothness.py": {"FINE", "_SIZES"}, "tones.py": {"_LINES"}, "validation.py": {"_DELAYS"},
    },
    "says where and when a mismatch is, after the verdict": {
        "locate.py": {"_SIGMAS", "_SUPPORTED_SIGMAS", "_GAP", "_VARIABLES", "_SCORE_SHARE", "_LEAST_SCORE"},
        "process_noise.py": {"_SEED", "LEVEL", "_FLOOR", "_RANGE", "_WINDOW", "_START_STD"},
        "regime.py": {"_SHIFTS", "_LEVEL", "_AREA", "_SHARE"},
    },
    "is what a report lists": {
        "consistency.py": {"_LISTED"}, "procedure.py": {"_LISTED", "_LISTED_PROBABILITY", "_REPORTED_DISTURBANCE"},
        "show.py": {"_CLOSE", "_NOT_EXCITED"},
    },
    "limits the next manoeuvre, after the verdict": {"next_run.py": {"_LONGEST"}},
    "is the version of a file": {"stored.py": {"_SCHEMA"}},
    "is a limit of the process": {"evidence.py": {"_MEMORY"}, "programs.py": {"_MANY"}},
    "is what is said where nothing was tested": {"verdict.py": {"NOTHING"}},
}  # fmt: skip
# modules whose numbers come after the verdict: none that decides may import them
AFTER = {"locate", "process_noise", "regime", "show", "next_run"}
# numbers other than 0 and 1 that something is compared with as they stand, by why
COMPARED = {
    "regime.py": {0.5},  # the area under the curve of what is chance
    "locate.py": {1e-9},  # rounding
    "summary.py": {0.995, 0.005},  # what would be rounded to all or none
}


def assigned(tree):
    """The names that a module assigns, each with its value."""
    for node in tree.body:
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = zip(target.elts, node.value.elts, strict=True)
            else:
                pairs = [(target, node.value)]
            yield from ((ast.unparse(name), value) for name, value in pairs)


def numbers(node):
    """The numbers that are written in it."""
    inner = (n.value for n in ast.walk(node) if isinstance(n, ast.Constant))
    return {value for value in inner if isinstance(value, int | float) and not isinstance(value, bool)}


def named_numbers(tree):
    """The names to which a module assigns numbers, or what has numbers in it."""
    return {name for name, value in assigned(tree) if numbers(value)}


def compared_numbers(tree):
    """The numbers of type float, other than 0 and 1, in the comparisons of a module."""
    found = set().union(*(numbers(node) for node in ast.walk(tree) if isinstance(node, ast.Compare)))
    return {value for value in found if isinstance(value, float) and value not in (0.0, 1.0)}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_no_module_but_the_settings_has_a_number_to_decide_by(path):
    """Claim: a module assigns just the numbers allowed for a reason, and compares with no other unnamed number."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    allowed = set().union(*(by_file.get(path.name, set()) for by_file in ALLOWED.values()))
    assert named_numbers(tree) == allowed, "numbers to decide by belong in settings.py"
    assert compared_numbers(tree) == COMPARED.get(path.name, set()), "name it in settings.py"


def test_no_decision_reads_a_module_whose_numbers_come_after_the_verdict():
    """Claim: the modules that say where a mismatch is, or what next, are imported by the whole path and each other."""
    for path in FILES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        modules = (node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
        imported = {module.rpartition(".")[2] for module in modules}
        assert not imported & AFTER or path.stem in {"procedure", *AFTER}, f"{path.name} decides by what is reported"


def test_the_search_for_numbers_finds_every_form():
    """Claim: pairs, annotations, negative and nested numbers and those in comparisons are found; names are not."""
    tree = ast.parse("A, _B = 1, x\nC: float = -2.5\n_D = (0.1, E)\nF = f(3)\nG = len(A)\nH = True\nI = 'j'\n")
    assert named_numbers(tree) == {"A", "C", "_D", "F"}
    tree = ast.parse("def f(x):\n    if x - y < -5.0 or 0.3 * x > 0.0 or x == 2:\n        return 0.7 * LEVEL\n")
    assert compared_numbers(tree) == {5.0, 0.3}


def _read(tree):
    """The names that a module reads as attributes of the settings."""
    attributes = (node for node in ast.walk(tree) if isinstance(node, ast.Attribute))
    return {node.attr for node in attributes if ast.unparse(node.value) == "settings"}


def test_settings_are_read_where_they_are_used():
    """Claim: no module of the room keeps a setting of its own, so that another value holds in all of a diagnosis."""
    for path in FILES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        whole = [node for node in tree.body if not isinstance(node, ast.FunctionDef | ast.ClassDef)]
        defaults = [node.args for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.Lambda)]
        assert not set().union(*map(_read, [*whole, *defaults])), f"{path.name} reads settings as it is imported"
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        traced = [node for node in functions if "compiled" in map(ast.unparse, node.decorator_list)]
        assert not set().union(*map(_read, traced)), f"{path.name} compiles settings into a program"
        named = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        assert "settings" not in named, f"{path.name} imports values of settings"


def test_every_setting_is_typed_explained_and_read_by_another_module():
    """Claim: each is annotated as final, has a comment directly above it, and is read in the room."""
    lines = (ROOM / "settings.py").read_text(encoding="utf-8").splitlines()
    nodes = [node for node in SETTINGS.body if isinstance(node, ast.Assign | ast.AnnAssign)]
    read = set().union(*(_read(ast.parse(path.read_text(encoding="utf-8"))) for path in FILES))
    for node in nodes:
        assert isinstance(node, ast.AnnAssign) and ast.unparse(node.annotation).startswith("Final["), ast.unparse(node)
        assert lines[node.lineno - 2].startswith("# "), ast.unparse(node)
        assert ast.unparse(node.target) in read, f"{ast.unparse(node.target)} decides nothing"
