"""A compiled library that is kept on disk is loaded only where it is whole and of this processor, else made anew."""

import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import jax
import pytest

from jaxsub.errors import InputError
from jaxsub.symbolic import foreign
from jaxsub.symbolic.compiler import compile_library, compiler

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")

SOURCE = "int answer(void) { return 42; }\n"


@pytest.fixture
def kept(tmp_path):
    """JAX's cache folder is this one for a test."""
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "kept"))
    yield tmp_path / "kept"
    jax.config.update("jax_compilation_cache_dir", before)


def answer(source=SOURCE):
    return foreign._library(source, foreign._key(source)).answer()


def libraries(folder):
    return sorted(path.name for path in folder.glob("*"))


def _truncated(path):
    path.write_bytes(path.read_bytes()[:2000])


def _garbled(path):
    content = bytearray(path.read_bytes())
    for at in range(64, len(content), 97):
        content[at] ^= 0xA5
    path.write_bytes(content)


def _one_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


DAMAGES = {
    "truncated": _truncated,
    "garbled": _garbled,
    "one bit": _one_bit,
    "empty": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("no library\n"),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"\0"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_library_is_made_anew(kept, damage, monkeypatch):
    assert answer() == 42
    (library,) = kept.glob("*.so")
    sound = library.read_bytes()
    # not in place: this process has mapped the file
    copy = library.with_suffix(".copy")
    copy.write_bytes(sound)
    DAMAGES[damage](copy)
    copy.replace(library)
    assert answer() == 42
    assert [path.read_bytes() for path in kept.glob("*")] == [sound]
    # the library that is whole is not compiled again
    monkeypatch.setattr(foreign, "compile_library", None)
    assert answer() == 42


def test_folder_under_the_librarys_name_is_passed_over(kept):
    assert answer() == 42
    (library,) = kept.glob("*.so")
    library.unlink()
    library.mkdir()
    assert answer() == 42


def test_library_of_another_processor_or_compiler_is_not_loaded(kept, monkeypatch):
    assert answer() == 42
    own = foreign._key(SOURCE)
    monkeypatch.setattr(foreign, "_target", lambda command: "#define __OTHER__ 1")
    assert foreign._key(SOURCE) != own
    assert answer() == 42
    assert len(libraries(kept)) == 2


def test_key_is_the_same_in_another_process_and_needs_no_proc():
    """Asked of the compiler alone, in a process that may not open /proc."""
    program = """
import builtins, pathlib
from jaxsub.symbolic import foreign
for place, name in ((builtins, "open"), (pathlib.Path, "open")):
    of = getattr(place, name)
    def closed(*arguments, of=of, **options):
        assert not str(arguments[0]).startswith("/proc"), arguments
        return of(*arguments, **options)
    setattr(place, name, closed)
print(foreign._key("int f;"))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == foreign._key("int f;")


@pytest.mark.parametrize("place", ["under a file", "read-only"])
def test_without_a_folder_to_write_the_library_is_made_in_a_temporary_one(tmp_path, kept, place):
    if place == "under a file":
        kept.write_text("in the way")
    else:
        kept.mkdir(mode=0o500)
        if os.access(kept, os.W_OK):
            pytest.skip("permissions do not bind this user")
    assert answer() == 42
    if place == "under a file":
        assert kept.read_text() == "in the way"


def test_full_disk_leaves_no_part_behind(kept, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(foreign.os, "fsync", full)
    assert answer() == 42
    assert libraries(kept) == []


def test_parts_of_writers_that_were_ended_are_removed(kept):
    kept.mkdir()
    old, new = kept / "jaxsub-old.part", kept / "jaxsub-new.part"
    old.write_bytes(b"half")
    new.write_bytes(b"half")
    os.utime(old, (time.time() - 7200.0,) * 2)
    assert answer() == 42
    assert not old.exists()
    assert new.exists()


def test_many_writers_at_once(kept):
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(lambda _: answer(), range(8))) == [42] * 8
    assert all(name.endswith(".so") for name in libraries(kept))
    assert answer() == 42


def test_compiler_may_have_arguments(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "cc -DNUMBER=42 '-DWORD=a b'")
    assert compiler() == ["cc", "-DNUMBER=42", "-DWORD=a b"]
    compile_library("int answer(void) { return NUMBER; }\n", tmp_path / "a.so", ("-shared", "-fPIC"), ((),))
    assert (tmp_path / "a.so").exists()


@pytest.mark.parametrize(
    ("command", "what"),
    [
        ("no-such-compiler -O2", r"^no-such-compiler: no C compiler of this name; install one"),
        ("cc 'half", r"^\$CC \"cc 'half\": is no command line .*; close its quotation marks$"),
    ],
)
def test_command_that_is_no_compiler_is_one_line(monkeypatch, command, what):
    monkeypatch.setenv("CC", command)
    with pytest.raises(InputError, match=what):
        compiler()


def test_error_of_the_compiler_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"^cc: does not compile a\.c: .*error.*; name another") as caught:
        compile_library(
            "#warning first\nint answer(void) { return nothing; }\n", tmp_path / "a.so", ("-shared",), ((),)
        )
    assert "\n" not in str(caught.value)
