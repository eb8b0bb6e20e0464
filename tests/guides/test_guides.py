"""What the guides tell a reader to type is what there is: their code runs, their commands and maps are understood."""

import re
import runpy
import shlex
from pathlib import Path

import pytest

from jaxsub.cli.app import app
from jaxsub.discrepancy import settings
from jaxsub.effects import VOCABULARY
from jaxsub.recording import read_selection

GUIDES = sorted((Path(__file__).parents[2] / "notebooks" / "guide").glob("*.md"))


def blocks(path, language=r"\w+"):
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def written(path, folder):
    """Put the blocks that begin with a comment `# name.suffix` into files of that name; the names."""
    found = [(match[1], block) for block in blocks(path) if (match := re.match(r"# (\w+\.\w+)\n", block))]
    for name, block in found:
        (folder / name).write_text(block, encoding="utf-8")
    return [name for name, _ in found]


def marked(path):
    # the posterior's other tests draw from it too, and its guide takes a minute; the other takes 14 s
    long = path.stem in ("posterior", "add-a-vehicle")
    return pytest.param(path, id=path.stem, marks=[pytest.mark.long] if long else [])


@pytest.mark.parametrize("path", [marked(p) for p in GUIDES if blocks(p, "python")])
def test_code_of_a_guide_runs(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    written(path, tmp_path)
    code = [block for block in blocks(path, "python") if not re.match(r"# \w+\.py\n", block)]
    Path("guide.py").write_text("\n".join(code), encoding="utf-8")
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
    assert app.commands[words[0]].make_context(words[0], list(words[1:])).params


LACKING = "## What such vehicles often lack"


@pytest.mark.parametrize("path", [path for path in GUIDES if LACKING in path.read_text(encoding="utf-8")])
def test_effects_that_a_guide_warns_of_can_be_named(path):
    _, _, text = path.read_text(encoding="utf-8").partition(LACKING)
    named = set(re.findall(r"`([a-z]+(?:-[a-z]+)+)`", text))
    assert named and named <= {kind.name for kind in VOCABULARY}


def test_map_of_a_guide_is_understood(tmp_path):
    (guide,) = [path for path in GUIDES if path.stem == "logs-and-data"]
    assert "map.toml" in written(guide, tmp_path)
    chosen = read_selection(tmp_path / "map.toml")
    assert chosen.every == 0.02
    assert chosen.term("delta_r[deg]") == (25.0, "", "actuator_servos.control[1]", 0.0)
    assert chosen.term("psi") == (1.0, "yaw", "vehicle_attitude.q", 0.0)


def test_constants_of_the_guide_are_settings():
    """Claim: the page on how a diagnosis works is short, and every constant that it names is one of the settings."""
    (guide,) = [path for path in GUIDES if path.stem == "how-diagnosis-works"]
    text = guide.read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Z][A-Z_]+)`", text))
    assert len(named) > 10 and named <= vars(settings).keys()
    assert len(text.splitlines()) <= 120
