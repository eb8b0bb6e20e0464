"""Commands set themselves up, once or again, without a home and with a damaged cache of compiled programs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROGRAM = """
from jaxsub.cli import session
for _ in range({starts}):
    session.start()
import jax, jax.numpy as jnp
def tripled(x):
    return 3.0 * x
print(jax.jit(tripled)(jnp.arange(3.0)))
"""


def ran(starts=1, before="", folder=None, **environment):
    base = {name: value for name, value in os.environ.items() if name not in ("HOME", "XDG_CACHE_HOME", "XLA_FLAGS")}
    done = subprocess.run(
        [sys.executable, "-c", before + PROGRAM.format(starts=starts)],
        env=base | {"PYTHONPATH": str(ROOT), "JAX_PLATFORMS": "cpu"} | environment,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "[0. 3. 6.]\n"
    return done.stderr


@pytest.mark.parametrize("home", ["/proc/none", pytest.param("/dev/null", marks=pytest.mark.long)])
def test_without_a_home_that_can_be_written_it_goes_on_and_says_so(home):
    said = ran(HOME=home)
    assert said.count("\n") == 1 and said.startswith("note: compiled programs are not kept")


UNKNOWN_USER = """
import pwd
def unknown(uid):
    raise KeyError(uid)
pwd.getpwuid = unknown
"""


def test_for_a_user_without_a_home_nothing_is_written_to_the_current_folder(tmp_path):
    """Claim: no folder named ~ comes to be there."""
    said = ran(before=UNKNOWN_USER, folder=tmp_path)
    assert said.count("\n") == 1 and "there is no home folder; set XDG_CACHE_HOME" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("given", "long", "expected"),
    [
        (None, False, "cpu"),
        pytest.param("", False, "cpu", marks=pytest.mark.long),
        pytest.param("cuda,cpu", False, "cuda,cpu", marks=pytest.mark.long),
        pytest.param(None, True, "None", marks=pytest.mark.long),
    ],
)
def test_short_commands_take_an_accelerator_only_where_it_is_named(given, long, expected):
    """Claim: what is not long runs on the processor, though JAX would pick a GPU; what the user names is kept."""
    program = f"from jaxsub.cli import session; session.start({long}); import jax; print(jax.config.jax_platforms)"
    base = {name: value for name, value in os.environ.items() if name != "JAX_PLATFORMS"}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=base | {"PYTHONPATH": str(ROOT)} | ({} if given is None else {"JAX_PLATFORMS": given}),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.stdout == f"{expected}\n", done.stderr


@pytest.mark.parametrize(
    "damage",
    [
        lambda entry: entry[: len(entry) // 2],
        pytest.param(lambda entry: b"", marks=pytest.mark.long),
        pytest.param(lambda entry: b"x" * 99, marks=pytest.mark.long),
    ],
)
def test_damaged_programs_are_replaced_with_one_note(tmp_path, damage):
    assert ran(XDG_CACHE_HOME=str(tmp_path)) == ""
    entries = sorted(tmp_path.rglob("*-cache"))
    assert any("tripled" in entry.name for entry in entries)
    for entry in entries:
        entry.write_bytes(damage(entry.read_bytes()))
    damaged = {entry: entry.read_bytes() for entry in entries}
    said = ran(XDG_CACHE_HOME=str(tmp_path))
    assert said.count("\n") == 1 and "damaged entries are replaced" in said
    assert all(entry.read_bytes() != before for entry, before in damaged.items())
    assert ran(XDG_CACHE_HOME=str(tmp_path)) == ""


@pytest.mark.long
def test_set_up_twice_the_damage_is_said_once(tmp_path):
    ran(XDG_CACHE_HOME=str(tmp_path))
    for entry in tmp_path.rglob("*-cache"):
        entry.write_bytes(b"damaged")
    said = ran(starts=3, XDG_CACHE_HOME=str(tmp_path))
    assert said.count("\n") == 1 and "damaged entries are replaced" in said


LEVEL = """
import os, sys
from pathlib import Path
from jaxsub.cli import session
session.start(recordings=[Path(name) for name in sys.argv[1:]])
print(os.environ["XLA_FLAGS"])
"""


@pytest.mark.parametrize(
    ("sizes", "given", "level"),
    [
        ([1000, 1000], "", 0),
        pytest.param([1000, 300_000], "", 1, marks=pytest.mark.long),
        ([1000], "--xla_backend_optimization_level=3", 3),
        pytest.param([], "", 1, marks=pytest.mark.long),
    ],
)
def test_programs_for_small_recordings_are_not_optimised(tmp_path, sizes, given, level):
    """Claim: XLA is told level 0 for small files, 1 for larger ones and what is none, and what the caller set stays."""
    paths = [tmp_path / f"{index}.csv" for index in range(len(sizes))]
    for path, size in zip(paths, sizes, strict=True):
        path.write_bytes(b"x" * size)
    done = subprocess.run(
        [sys.executable, "-c", LEVEL, *map(str, paths)],
        env=os.environ | {"PYTHONPATH": str(ROOT), "XLA_FLAGS": given, "XDG_CACHE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert f"--xla_backend_optimization_level={level}" in done.stdout.split(), done.stderr
