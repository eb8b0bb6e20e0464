"""--overwrite replaces what jaxsub wrote and is as it was written, and refuses everything else by name."""

import os
import shutil
from contextlib import suppress

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from trees import tree

from jaxsub.cli.output import fresh_file, fresh_folder
from jaxsub.errors import InputError, OutputError


def result(out, text="old", overwrite=False, inputs=()):
    with fresh_folder(out, overwrite, inputs) as folder:
        (folder / "figures").mkdir()
        (folder / "figures" / "a.png").write_text(text)
        (folder / "empty").mkdir()
        (folder / "result.json").write_text(text)


def single(out, text="old", overwrite=False, inputs=()):
    with fresh_file(out, overwrite, inputs) as path:
        path.write_text(text)


def refused(folder, words, call):
    before = tree(folder)
    with pytest.raises(InputError) as caught:
        call()
    assert tree(folder) == before
    assert all(word in str(caught.value) for word in words), caught.value
    assert not isinstance(caught.value, OutputError)


@pytest.mark.parametrize("make", [result, single])
def test_own_result_is_replaced_again_and_again(tmp_path, make):
    for text in ("one", "two", "two", "three"):
        make(tmp_path / "out", text, overwrite=text != "one")
    held = tmp_path / "out"
    assert (held / "result.json" if held.is_dir() else held).read_text() == "three"
    refused(tmp_path, ("out: already exists", "--overwrite"), lambda: make(tmp_path / "out"))


CHANGES = {
    "added file": (lambda out: (out / "notes.txt").write_text("mine"), "notes.txt"),
    "added file below": (lambda out: (out / "figures" / "mine.png").write_text("mine"), "mine.png"),
    "added folder": (lambda out: (out / "mine").mkdir(), "mine"),
    "changed file": (lambda out: (out / "result.json").write_text("alt"), "result.json"),
    "file became a link": (lambda out: [(out / "result.json").unlink(), (out / "result.json").symlink_to("x")],
                           "result.json"),
    "no manifest": (lambda out: (out / ".jaxsub.jsonl").unlink(), "was not written by jaxsub"),
    "manifest of something else": (lambda out: (out / ".jaxsub.jsonl").write_text('{"files": []}'), "no manifest"),
}  # fmt: skip


@pytest.mark.parametrize("name", CHANGES)
def test_folder_that_somebody_changed_is_refused_by_name(tmp_path, name):
    change, word = CHANGES[name]
    result(tmp_path / "out")
    change(tmp_path / "out")
    refused(tmp_path, (word, "--overwrite replaces nothing else"), lambda: result(tmp_path / "out", overwrite=True))


def test_folder_with_a_file_removed_is_replaced(tmp_path):
    result(tmp_path / "out")
    (tmp_path / "out" / "result.json").unlink()
    result(tmp_path / "out", "new", overwrite=True)
    assert (tmp_path / "out" / "result.json").read_text() == "new"


def test_file_that_somebody_wrote_or_changed_is_refused(tmp_path):
    (tmp_path / "run.csv").write_text("t,x\n")
    refused(tmp_path, ("run.csv", "not written by jaxsub"), lambda: single(tmp_path / "run.csv", overwrite=True))
    single(tmp_path / "out.csv")
    (tmp_path / "out.csv").write_text("changed")
    refused(tmp_path, ("out.csv", "changed since"), lambda: single(tmp_path / "out.csv", overwrite=True))
    result(tmp_path / "folder")
    refused(tmp_path, ("is a folder",), lambda: single(tmp_path / "folder", overwrite=True))
    refused(tmp_path, ("run.csv",), lambda: result(tmp_path / "run.csv", overwrite=True))


@pytest.mark.parametrize("make", [result, single])
def test_file_of_jaxsub_that_is_an_input_is_refused(tmp_path, make, monkeypatch):
    single(tmp_path / "run.csv")
    (tmp_path / "same.csv").hardlink_to(tmp_path / "run.csv")
    (tmp_path / "link.csv").symlink_to("run.csv")
    for given_as in ("run.csv", "same.csv", "link.csv"):
        call = lambda name=given_as: make(tmp_path / "run.csv", overwrite=True, inputs=[tmp_path / name])
        refused(tmp_path, (f"is the input {tmp_path / given_as}",), call)
    refused(tmp_path, ("is a link",), lambda: make(tmp_path / "link.csv", overwrite=True))
    monkeypatch.chdir(tmp_path)
    for name in (".", "..", "/", str(tmp_path), ""):
        with pytest.raises(InputError, match=r"is a folder|current folder"):
            make(type(tmp_path)(name), overwrite=True)


def test_folder_that_holds_an_input_is_refused(tmp_path):
    result(tmp_path / "out")
    path = tmp_path / "out" / "result.json"
    refused(tmp_path, ("holds the input",), lambda: result(tmp_path / "out", overwrite=True, inputs=[path]))
    (tmp_path / "link").symlink_to("out")
    through = tmp_path / "link" / "result.json"
    refused(tmp_path, ("holds the input",), lambda: result(tmp_path / "out", overwrite=True, inputs=[through]))
    refused(tmp_path, ("is a link",), lambda: result(tmp_path / "link", overwrite=True))


@pytest.mark.parametrize("name", ["x" * 300, "nul\0name", "run.csv/out", "run.csv/deeper/out"])
def test_path_that_cannot_be_is_one_line(tmp_path, name):
    (tmp_path / "run.csv").write_text("mine")
    refused(tmp_path, ("choose another --out",), lambda: result(tmp_path / name, overwrite=True))


def test_result_that_changes_during_the_work_stays_and_the_new_one_lies_beside_it(tmp_path):
    result(tmp_path / "out")
    with (
        pytest.raises(OutputError, match=r"result.json: .*meanwhile; the results are in .*out-1"),
        fresh_folder(tmp_path / "out", True) as folder,
    ):
        (folder / "result.json").write_text("new")
        (tmp_path / "out" / "result.json").write_text("edited")
    assert (tmp_path / "out" / "result.json").read_text() == "edited"
    assert (tmp_path / "out-1" / "result.json").read_text() == "new"
    assert not list(tmp_path.glob(".jaxsub-*"))


NAMES = st.sampled_from(["a", "b", "run.csv", "out", ".jaxsub.jsonl", ".hidden"])
PATHS = st.lists(NAMES, min_size=1, max_size=3).map("/".join)


def grow(root, files, links, results):
    """A tree of a user's files and links with results of jaxsub in it; what does not fit is left out."""
    for path, text in files.items():
        with suppress(OSError):
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text)
    for path, target in links.items():
        with suppress(OSError):
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).symlink_to(root / target)
    written = set()
    for path in results:
        before = set(tree(root))
        with suppress(InputError):
            result(root / path)
            written |= set(tree(root)) - before
    return written


@pytest.mark.parametrize("make", [result, single])
def test_links_that_lead_in_a_circle_are_refused(tmp_path, make):
    """Claim: below such a link nothing can be written, and beside an input below one everything can."""
    (tmp_path / "a").symlink_to(tmp_path / "a")
    with pytest.raises(InputError, match="is not a folder"):
        make(tmp_path / "a" / "out")
    make(tmp_path / "out", inputs=[tmp_path / "a" / "run.csv"])
    assert (tmp_path / "out").exists()


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    files=st.dictionaries(PATHS, st.text("xyz", max_size=3), max_size=5),
    links=st.dictionaries(PATHS, PATHS, max_size=2),
    results=st.lists(PATHS, max_size=2),
    later=st.dictionaries(PATHS, st.text("xyz", max_size=3), max_size=2),
    out=PATHS,
    inputs=st.lists(PATHS, max_size=2),
    make=st.sampled_from([result, single]),
)
def test_no_file_of_somebody_else_is_lost(tmp_path, files, links, results, later, out, inputs, make):
    root = tmp_path / "root"
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    written = grow(root, files, links, results)
    ours = {name: held for name, held in tree(root).items() if name in written}
    for path, text in later.items():
        with suppress(OSError):
            os.makedirs((root / path).parent, exist_ok=True)
            (root / path).write_text(text)
    before = tree(root)
    mine = {name: held for name, held in before.items() if ours.get(name) != held}
    read = {name: held for name, held in before.items() if name in inputs and held[0] == "file"}
    done = True
    try:
        make(root / out, "fresh", True, [root / path for path in inputs])
    except InputError:
        done = False
    after = tree(root)
    assert (mine | read).items() <= after.items()
    assert done or after == before
