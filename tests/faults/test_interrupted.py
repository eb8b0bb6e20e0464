"""Whatever ends a process that writes results, the old ones stay whole and the next call clears what it left."""

import re
import signal

import pytest
from trees import ended, finished, tree, write, writer

KINDS = ["folder", "file"]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_old_result_stays_and_what_is_left_is_cleared(tmp_path, kind, number):
    out = tmp_path / "out"
    write(kind, out, "old")
    before = tree(tmp_path)
    process, said = writer(kind, out, "new", "--overwrite")
    assert said == "written"
    code = ended(process, number)
    assert code == (-9 if number == signal.SIGKILL else 130)
    left = {name: held for name, held in tree(tmp_path).items() if not name.startswith(".jaxsub-")}
    assert left == before
    assert (left == tree(tmp_path)) == (number != signal.SIGKILL)
    write("file", tmp_path / "other", "else")
    assert {name: held for name, held in tree(tmp_path).items() if "other" not in name} == before
    write(kind, out, "new", "--overwrite")
    assert not list(tmp_path.glob(".jaxsub-*"))
    assert ((out / "a.txt") if kind == "folder" else out).read_text() == "new"


@pytest.mark.parametrize("kind", KINDS)
def test_second_writer_is_told_which_process_writes(tmp_path, kind):
    out = tmp_path / "out"
    first, said = writer(kind, out, "first")
    assert said == "written"
    second, said = writer(kind, out, "second")
    second.communicate(timeout=60)
    assert second.returncode == 2
    assert re.search(rf"out: process {first.pid} on \S+ is writing there; wait for it or choose another --out", said)
    write(kind, tmp_path / "elsewhere", "third")
    assert finished(first) == 0
    assert ((out / "a.txt") if kind == "folder" else out).read_text() == "first"
    assert not list(tmp_path.glob(".jaxsub-*"))


def test_scratch_folder_of_another_host_is_left_alone_and_named(tmp_path):
    out = tmp_path / "out"
    process, _ = writer("folder", out, "x")
    ended(process, signal.SIGKILL)
    (left,) = tmp_path.glob(".jaxsub-*")
    other = left.rename(left.with_name(re.sub(r"-(\d+)-.*", r"-\1-elsewhere", left.name)))
    process, said = writer("folder", out, "y")
    process.communicate(timeout=60)
    assert process.returncode == 2 and "on elsewhere is writing" in said and f"remove {other}" in said
    write("folder", tmp_path / "free", "z")
    assert other.is_dir()


def test_result_that_was_moved_aside_is_moved_back(tmp_path):
    out = tmp_path / "out"
    write("folder", out, "old")
    before = tree(tmp_path)
    process, _ = writer("folder", out, "new", "--overwrite")
    ended(process, signal.SIGKILL)
    (left,) = tmp_path.glob(".jaxsub-*")
    (left / "replaced").mkdir()
    out.rename(left / "replaced" / "out")
    write("file", tmp_path / "other", "else")
    assert {name: held for name, held in tree(tmp_path).items() if "other" not in name} == before


def test_parents_made_for_a_result_go_where_none_came_to_be(tmp_path):
    process, _ = writer("folder", tmp_path / "a" / "b" / "out", "x")
    assert ended(process, signal.SIGINT) == 130
    assert tree(tmp_path) == {}
