"""Whatever bytes a file holds, it loads as a valid recording or is refused in one line that names it, soon."""

import functools
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from file_examples import COLUMNS, WRITERS
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording import load

LONGEST = 20.0  # s for one file of some kB
fuzz = functools.partial(
    settings, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def is_loaded_or_refused(path: Path, content: bytes, columns: dict[str, str] | None = None) -> None:
    path.write_bytes(content)
    started = time.perf_counter()
    try:
        run = load(path, columns)
    except InputError as error:
        assert str(error).startswith(str(path))
        assert len(str(error).splitlines()) == 1
    else:
        assert np.all(np.diff(run.times) > 0)
        assert not any(np.isinf(values).any() for values in run.columns.values())
    assert time.perf_counter() - started < LONGEST


WORDS = 't t[s] u u[m/s] (s) [ ] 0 1 2.5 2,5 1.234 -1e400 nan NA - 2024-01-01 T00:00:01 ° \ufeff , ; | " # % / sep=;'
cells = st.sampled_from([*WORDS.split(" "), "\t", "\n", "\r", "\0", " ", "\n0,1\n1,2\n", "\n0;1\n1;2\n"])
texts = (
    st.binary(max_size=200)
    | st.text(max_size=80).map(str.encode)
    | st.lists(cells, max_size=30).map("".join).map(str.encode)
    | st.lists(cells, max_size=30).map("".join).map(lambda text: text.encode("utf-16"))
    | st.lists(cells, max_size=30).map("".join).map(lambda text: text.encode("cp1252", "replace"))
)
damage = {
    "edits": st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=8),
    "keep": st.sampled_from([0.05, 0.1, 0.5, 0.9, 0.99, 1, 1]),
    "more": st.binary(max_size=8),
}


def damaged(folder: Path, kind: str, edits: list, keep: float, more: bytes) -> None:
    whole = folder / f"whole.{kind}"
    if not whole.exists():
        WRITERS[kind](whole)
    content = bytearray(whole.read_bytes())
    for place, byte in edits:
        content[int(place * (len(content) - 1))] = byte
    suffix = kind.rpartition(".")[2]
    is_loaded_or_refused(folder / f"run.{suffix}", bytes(content[: int(keep * len(content))]) + more, COLUMNS.get(kind))


def both(examples: int) -> list[Callable]:
    return [pytest.param(examples), pytest.param(10_000, marks=pytest.mark.long)]


@pytest.mark.parametrize("examples", both(200))
def test_any_bytes_as_text_load_or_are_refused(tmp_path, examples):
    @fuzz(max_examples=examples)
    @given(content=texts, suffix=st.sampled_from([".csv", ".txt"]))
    def loads_or_is_refused(content, suffix):
        is_loaded_or_refused(tmp_path / f"run{suffix}", content)

    loads_or_is_refused()


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("examples", both(60))
def test_damaged_binary_file_loads_or_is_refused(tmp_path, kind, examples):
    pytest.importorskip("pymavlink")

    @fuzz(max_examples=examples)
    @given(**damage)
    def loads_or_is_refused(edits, keep, more):
        damaged(tmp_path, kind, edits, keep, more)

    loads_or_is_refused()


@pytest.mark.parametrize("kind", sorted({kind.rpartition(".")[2] for kind in WRITERS}))
@pytest.mark.parametrize("examples", both(30))
def test_any_bytes_as_binary_file_are_refused(tmp_path, kind, examples):
    @fuzz(max_examples=examples)
    @given(content=st.binary(min_size=1, max_size=300))
    def loads_or_is_refused(content):
        is_loaded_or_refused(tmp_path / f"run.{kind}", content, COLUMNS.get(kind))

    loads_or_is_refused()
