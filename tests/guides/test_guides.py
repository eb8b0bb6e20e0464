"""What the guides tell a reader to type is what there is: their code runs, their commands and maps are understood."""

import re
import runpy
import shlex
from pathlib import Path

import pytest

from jaxsub.cli.app import app
from jaxsub.recording import read_selection

GUIDES = sorted((Path(__file__).parents[2] / "notebooks" / "guide").glob("*.md"))


def blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("path", [p for p in GUIDES if blocks(p, "python")], ids=lambda path: path.stem)
def test_code_of_a_guide_runs(path, tmp_path, monkeypatch, capsys):
    if path.stem == "posterior":
        pytest.importorskip("numpyro")
        pytest.importorskip("arviz")
    monkeypatch.chdir(tmp_path)
    Path("guide.py").write_text("\n".join(blocks(path, "python")), encoding="utf-8")
    runpy.run_path("guide.py")


def commands():
    for path in GUIDES:
        for block in blocks(path, "bash"):
            for line in block.splitlines():
                words = shlex.split(line, comments=True)
                if words and words[0] == "jaxsub":
                    yield pytest.param(words[1:], id=f"{path.stem}: {' '.join(words[1:3])}")


@pytest.mark.parametrize("words", list(commands()))
def test_command_of_a_guide_is_understood(words):
    command = app.commands[words[0]]
    context = command.make_context(words[0], list(words[1:]), resilient_parsing=False)
    assert context.params


@pytest.mark.parametrize("path", [p for p in GUIDES if blocks(p, "toml")], ids=lambda path: path.stem)
def test_map_of_a_guide_is_understood(path, tmp_path):
    for number, block in enumerate(blocks(path, "toml")):
        (tmp_path / f"{number}.toml").write_text(block, encoding="utf-8")
        chosen = read_selection(tmp_path / f"{number}.toml")
        assert all(chosen.term(header).channel for header in chosen.columns)
