"""README and pages of experiments: measured numbers name their command; commands, calls and links exist; short text."""

import ast
import importlib
import importlib.util
import inspect
import re
import shlex
from pathlib import Path

import pytest

import jaxsub
from experiments import tables as tables_of
from jaxsub.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "experiments").glob("*/README.md"))]
LINKED = [
    *PAGES,
    ROOT / "experiments" / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "notebooks" / "guide").glob("*.md")),
]
TEXTS = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in PAGES}
README = TEXTS["README.md"]
EXPERIMENT = re.compile(r"python -m (experiments\.[a-z_]+)([^`\n]*)")
MADE_ON = re.compile(r"\]\((experiments/\w+/README\.md)\)")


def sections():
    """README's chapters by title and the pages of experiments by path, with their text."""
    parts = re.split(r"^## (.*)$", README, flags=re.MULTILINE)
    chapters = dict(zip(parts[1::2], parts[2::2], strict=True))
    return chapters | {name: text for name, text in TEXTS.items() if name != "README.md"}


def tables(text):
    return re.findall(r"^\|.*(?:\n\|.*)+", text, re.MULTILINE)


def measured(table):
    """Whether a table has numbers in it."""
    rows = table.splitlines()[2:]
    return any(re.search(r"\d", cell) for row in rows for cell in row.strip("|").split("|")[1:])


def experiments():
    return sorted({(match[1], match[2].strip()) for text in TEXTS.values() for match in EXPERIMENT.finditer(text)})


def test_readme_has_tables_and_commands_to_look_at():
    assert len([t for text in sections().values() for t in tables(text) if measured(t)]) >= 5
    assert len(experiments()) >= 5


@pytest.mark.parametrize("title", [t for t, text in sections().items() if any(map(measured, tables(text)))])
def test_every_table_of_numbers_names_its_command(title):
    """Claim: a command stands before the table or in each row, or each row links to the page where one does."""
    text = sections()[title]
    for table in filter(measured, tables(text)):
        if not EXPERIMENT.search(text[: text.index(table)]):
            for row in table.splitlines()[2:]:
                page = MADE_ON.search(row)
                assert EXPERIMENT.search(TEXTS[page[1]] if page else row), f"no command in: {row[:80]}"


@pytest.mark.parametrize("row", [row for row in README.splitlines() if MADE_ON.search(row)])
def test_counts_of_readme_stand_on_the_page_that_they_are_from(row):
    """Claim: a page whose numbers were measured anew leaves no earlier ones in README."""
    page = TEXTS[MADE_ON.search(row)[1]]
    assert [count for count in re.findall(r"\d+ of \d+", row) if count not in page] == []


@pytest.mark.parametrize(("module", "options"), experiments())
def test_every_command_exists_with_what_it_is_given(module, options):
    spec = importlib.util.find_spec(module)
    assert spec is not None, f"there is no {module}"
    if spec.submodule_search_locations:
        assert importlib.util.find_spec(f"{module}.__main__") is not None, f"{module} cannot be run"
    folder = Path(spec.origin).parent
    source = "\n".join(
        path.read_text(encoding="utf-8") for path in [*folder.glob("*.py"), ROOT / "experiments/parts.py"]
    )
    words = [word for word in shlex.split(options.partition(" until ")[0]) if word not in ("DIR",)]
    for word in words:
        if word.startswith("--"):
            assert f'"{word}"' in source, f"{module} has no option {word}"
        elif not re.fullmatch(r"[\d.]+", word):
            assert re.search(rf"\b{re.escape(word)}\b", source), f"{module} knows nothing of {word}"


BASH = "\n".join(re.findall(r"^```bash\n(.*?)^```", README, re.MULTILINE | re.DOTALL))


@pytest.mark.parametrize("line", re.findall(r"^jaxsub .*$", BASH, re.MULTILINE))
def test_every_command_of_jaxsub_is_understood(line):
    words = shlex.split(line, comments=True)[1:]
    assert app.commands[words[0]].make_context(words[0], words[1:]).params


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_leads_to_a_file(page):
    text = re.sub(r"```.*?```|`[^`\n]*`", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for address in re.findall(r"(?:\]\(|src=\")([^)\"\s]+)", text):
        path = address.partition("#")[0]
        assert re.match(r"https?:", address) or not path or (page.parent / path).is_file(), address


def sentences(text):
    """Sentences of a document's paragraphs and lists, without code, tables and headings."""
    prose = re.sub(r"^```[\s\S]*?^```|^\|.*$|^#.*$|^!\[.*$|^<.*$", "", text, flags=re.MULTILINE)
    for paragraph in re.split(r"\n\s*\n|^\s*(?:-|\d+\.) ", prose, flags=re.MULTILINE):
        yield from re.split(r"[.!?]\**\s+", " ".join(paragraph.split()))


def test_readme_is_short():
    """Claim: README has at most 200 lines, and none of its tables more than 8 rows."""
    assert len(README.splitlines()) <= 200
    assert max(len(table.splitlines()) - 2 for table in tables(README)) <= 8


@pytest.mark.parametrize("page", LINKED, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_sentence_is_over_30_words(page):
    found = sentences(page.read_text(encoding="utf-8"))
    assert [sentence for sentence in found if len(sentence.split()) > 30] == []


def test_length_of_sentences_is_seen():
    text = "# A b\n\nOne two.\nThree four five.\n\n- six\n- seven eight\n\n| a b c d |\n\n```\nx y z w v\n```\n"
    assert max(len(sentence.split()) for sentence in sentences(text)) == 3


@pytest.mark.parametrize("page", tables_of.pages(), ids=lambda page: page.parent.name)
def test_tables_are_made_of_committed_results(page):
    assert "<!-- table: " in page.read_text(encoding="utf-8")
    assert page.read_text(encoding="utf-8") == tables_of.generated(page), "run python -m experiments.tables"


def calls():
    """Calls of what a block of Python imports from jaxsub, or takes from `js`, with what is called."""
    for block in re.findall(r"^```python\n(.*?)^```", README, re.MULTILINE | re.DOTALL):
        tree = ast.parse(block)
        imported = {
            alias.name: getattr(importlib.import_module(node.module), alias.name)
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("jaxsub")
            for alias in node.names
        }
        imported |= {f"js.{name}": getattr(jaxsub, name) for name in jaxsub.__all__ if f"js.{name}(" in block}
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and (called := imported.get(ast.unparse(node.func))) is not None:
                yield pytest.param(called, node, id=ast.unparse(node))


def test_python_calls_the_front_door():
    assert {"js.fit", "js.diagnose", "js.simulate"} <= {param.id.partition("(")[0] for param in calls()}


@pytest.mark.parametrize(("called", "call"), list(calls()))
def test_every_call_of_python_is_understood(called, call):
    """Claim: what is called takes the arguments that it is given."""
    names = {keyword.arg: None for keyword in call.keywords if keyword.arg}
    inspect.signature(called).bind_partial(*call.args, **names)
