"""Every notebook runs from a fresh kernel without an error, and is kept with the outputs of such a run.

A notebook whose metadata say `jaxsub.data` needs that data set, and ends with a word where it is absent; one that says
`jaxsub.long` takes minutes and is run with `-m long`.
"""

import json
import subprocess
import sys

import jax
import nbformat
import pytest

from experiments.data import folders
from experiments.notebooks import HERE, execute, needs

NOTEBOOKS = {path.stem: path for path in sorted(HERE.glob("*.ipynb"))}
KEPT = {name: nbformat.read(path, as_version=4) for name, path in NOTEBOOKS.items()}
LARGEST = 400_000  # bytes
# what a kept output must not show: places on the machine that made it
PLACES = ("/tmp/", "/home/", "/root/", "/work/", "/var/folders/", "C:\\")


def marked(name):
    long = KEPT[name].metadata.get("jaxsub", {}).get("long", False)
    return pytest.param(name, marks=[pytest.mark.long] if long else [])


def cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def shown(cell):
    """The text of a cell's outputs."""
    return "".join(o.get("text", "") or o.get("data", {}).get("text/plain", "") for o in cell.outputs)


@pytest.mark.parametrize("name", list(map(marked, NOTEBOOKS)))
def test_notebook_runs_without_an_error(name):
    data = needs(KEPT[name])
    if data and not any((place / data).is_dir() for place in folders()):
        pytest.skip(f"the recordings {data} are not here")
    # compiled as in the other tests: with little optimisation, and what an earlier run compiled is used again
    kept = str(jax.config.jax_compilation_cache_dir or "")
    fresh = execute(NOTEBOOKS[name], {"JAX_DISABLE_MOST_OPTIMIZATIONS": "1", "JAX_COMPILATION_CACHE_DIR": kept})
    assert any(cell.outputs for cell in cells(fresh))
    assert not [o for cell in cells(fresh) for o in cell.outputs if o.get("name") == "stderr"]


def test_every_call_in_a_notebook_is_one_that_the_package_takes(tmp_path):
    # at once, for lessons that take minutes to run: that what they import is there, and is called as it is declared
    kinds = {"typeCheckingMode": "off", "reportCallIssue": "error"}
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(kinds))
    for name, notebook in KEPT.items():
        (tmp_path / f"lesson_{name}.py").write_text("\n".join(cell.source for cell in cells(notebook)) + "\n")
    command = ["pyright", "--pythonpath", sys.executable]
    checked = subprocess.run([sys.executable, "-m", *command], cwd=tmp_path, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout


@pytest.mark.parametrize("name", [name for name in NOTEBOOKS if needs(KEPT[name])])
def test_notebook_without_its_data_says_so_and_goes_no_further(name, tmp_path):
    fresh = execute(NOTEBOOKS[name], {"JAXSUB_DATA": str(tmp_path)})
    said = [cell for cell in cells(fresh) if cell.outputs]
    assert len(said) == 1
    assert needs(KEPT[name]) in shown(said[0])


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_kept_outputs_are_those_of_one_run_from_top_to_bottom(name):
    code = cells(KEPT[name])
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1)), "run it from a fresh kernel"
    kinds = {output.output_type for cell in code for output in cell.outputs}
    assert "error" not in kinds
    pictures = [o for cell in code for o in cell.outputs if "image/png" in o.get("data", {})]
    assert len(pictures) >= 2, "a lesson shows what it says"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_kept_outputs_say_nothing_of_the_machine_that_made_them(name):
    code = cells(KEPT[name])
    assert not [o for cell in code for o in cell.outputs if o.get("name") == "stderr"], "a warning was kept"
    text = "".join(map(shown, code))
    assert not [place for place in PLACES if place in text]
    assert NOTEBOOKS[name].stat().st_size < LARGEST
    assert KEPT[name].metadata.kernelspec.name == "python3"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_lesson_has_a_question_an_equation_conclusions_and_an_exercise(name):
    text = "\n".join(cell.source for cell in KEPT[name].cells if cell.cell_type == "markdown")
    assert text.startswith(f"# {int(name[:2])}. "), "numbered as its file is"
    for part in ("**The question.**", "**The physics.**", "$$", "## What to conclude", "## Exercise"):
        assert part in text
