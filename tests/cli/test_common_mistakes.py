"""The mistakes that a new user most likely makes end every command in one line that says where, what and what to do."""

import pytest
from rigs import write_rig

from jaxsub.cli import main

COMMANDS = ("check", "identify", "diagnose", "simulate", "sweep")


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A folder with a vehicle file and a recording that are in order."""
    folder = tmp_path_factory.mktemp("rig")
    write_rig(folder, samples=60)
    return folder


def edited(name, old, new):
    """A mistake: `old` in the file `name` became `new`."""

    def make(folder):
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text, text[:300]
        (folder / name).write_text(text.replace(old, new, 1), encoding="utf-8")

    return make


def without_column(name):
    def make(folder):
        lines = [line.split(",") for line in (folder / "run.csv").read_text(encoding="utf-8").splitlines()]
        at = lines[0].index(name)
        kept = [",".join(cell for i, cell in enumerate(line) if i != at) for line in lines]
        (folder / "run.csv").write_text("\n".join(kept), encoding="utf-8")

    return make


def blank_cell(folder):
    lines = (folder / "run.csv").read_text(encoding="utf-8").splitlines()
    at = lines[0].split(",").index("f")
    cells = lines[20].split(",")
    cells[at] = ""
    lines[20] = ",".join(cells)
    (folder / "run.csv").write_text("\n".join(lines), encoding="utf-8")


def all_fixed(folder):
    text = (folder / "vehicle.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[coefficients]")
    body, mark, tail = rest.partition("\n[")
    lines = [
        f"{line.split('=')[0].strip()} = {{ value = {line.partition('=')[2].strip()}, fixed = true }}"
        if line.partition("=")[2].strip()[:1].isdigit()
        else line.replace("{", "{ fixed = true,", 1)
        if "=" in line
        else line
        for line in body.splitlines()
    ]
    (folder / "vehicle.toml").write_text(head + "[coefficients]" + "\n".join(lines) + mark + tail, encoding="utf-8")


def nothing(folder):
    pass


# name: (what is done to the files, the arguments, words of the answer, commands that it applies to)
FILES = ["vehicle.toml", "run.csv"]
MISTAKES = {
    "swapped": (nothing, ["run.csv", "vehicle.toml"], ("run.csv", "first"), COMMANDS),
    "mistyped vehicle": (nothing, ["vehicel.toml", "run.csv"], ("vehicel.toml", "cannot be read"), COMMANDS),
    "mistyped run": (nothing, ["vehicle.toml", "rum.csv"], ("rum.csv", "no such file"), COMMANDS),
    "no run": (nothing, ["vehicle.toml"], ("RUN",), COMMANDS),
    "folder as run": (nothing, ["vehicle.toml", "."], ("folder",), COMMANDS),
    "unknown extension": (nothing, ["vehicle.toml", "vehicle.toml"], ("extension", ".csv"), COMMANDS),
    "broken TOML": (edited("vehicle.toml", "[coefficients]", "[coefficients"), FILES, ("line",), COMMANDS),
    "mistyped key": (edited("vehicle.toml", "[inputs]", "[input]"), FILES, ("did you mean inputs",), COMMANDS),
    "mistyped coefficient": (edited("vehicle.toml", "D_x", "D_xx"), FILES, ("D_xx", "D_x"), COMMANDS),
    "other schema": (edited("vehicle.toml", "schema = 1", "schema = 2"), FILES, ("schema",), COMMANDS),
    "no time column": (edited("run.csv", "t,", "time,"), FILES, ("time", "rename"), COMMANDS),
    "no input column": (without_column("f"), FILES, ("'f'",), COMMANDS),
    "no output column": (without_column("x"), FILES, ("'x'",), ("identify", "diagnose", "sweep")),
    "gap in an input": (blank_cell, FILES, ("row 21", "'f'"), COMMANDS),
    "mistyped unit": (edited("run.csv", "x_rate", "x_rate[metre/s/s/furlng]"), FILES, ("furlng",), COMMANDS),
    "text in a cell": (edited("run.csv", "\n", "\nstart,"), FILES, ("run.csv",), COMMANDS),
    "same run twice": (nothing, [*FILES, "run.csv"], ("run.csv",), ("check", "identify", "diagnose", "sweep")),
    "all fixed": (all_fixed, FILES, ("fixed",), ("identify", "diagnose", "sweep")),
    "mistyped option": (
        nothing,
        [*FILES, "--overwrit"],
        ("--overwrit",),
        COMMANDS[1:],
    ),
    "out exists": (nothing, FILES, ("--overwrite",), ("identify", "diagnose", "simulate")),
}
CASES = [(name, command) for name, (*_, commands) in MISTAKES.items() for command in commands]


@pytest.mark.parametrize(("name", "command"), CASES)
def test_mistake_ends_in_one_line(rig, tmp_path, monkeypatch, capsys, name, command):
    make, arguments, words, _ = MISTAKES[name]
    for file in rig.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    make(tmp_path)
    monkeypatch.chdir(tmp_path)
    out = {"check": [], "simulate": ["--out", "a.csv"]}.get(command, ["--out", "a"])
    if name == "out exists":
        (tmp_path / out[1]).mkdir() if command != "simulate" else (tmp_path / out[1]).write_text("mine")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    starts = ["--starts", "2"] if command == "sweep" else []
    monkeypatch.setattr("sys.argv", ["jaxsub", command, *arguments, *out, *starts])
    with pytest.raises(SystemExit) as stop:
        main()
    printed = capsys.readouterr()
    assert stop.value.code == 2, printed.err
    errors = [line for line in printed.err.splitlines() if line.startswith("jaxsub: ")]
    # `check` lists what is wrong with runs in its table, and ends like others where the vehicle or the call is wrong
    listed = [line for line in printed.out.splitlines() if line.startswith("│ error")]
    shown = errors or (listed if command == "check" else [])
    assert len(shown) >= 1 and len(errors) <= 1 and all(word in " ".join(shown) for word in words), printed
    assert "Traceback" not in printed.err
    assert before == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
