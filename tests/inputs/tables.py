"""What cases of files share: a file loaded from text, and what its recording must be."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from corpus import Case

from jaxsub.recording import Recording, load


def text_case(
    name: str,
    text: str | bytes,
    *refused: str,
    suffix: str = ".csv",
    encoding: str = "utf-8",
    **expected: Any,
) -> Case:
    """A file of `text`, refused with those words, or read as the columns `expected`; `said` is in a note."""
    content = text if isinstance(text, bytes) else text.encode(encoding)

    def make(folder: Path) -> Recording:
        path = folder / f"run{suffix}"
        path.write_bytes(content)
        return load(path)

    return Case(name, make, refused, None if refused else reads(**expected))


def reads(said: str = "", first_row: int | None = None, **expected: Any) -> Callable[[object], None]:
    """Checks that a recording holds exactly the columns `expected`, with `t`, and a note with the words `said`."""

    def check(run: object) -> None:
        assert isinstance(run, Recording)
        columns: Mapping[str, np.ndarray] = {"t": run.times, **run.columns}
        assert set(columns) == set(expected), set(columns)
        for name, values in expected.items():
            np.testing.assert_allclose(columns[name], values, rtol=1e-14, atol=1e-300)
        notes = " | ".join(finding.line() for finding in run.findings)
        assert said in notes and bool(said) == bool(notes), notes
        assert first_row in (None, run.first_row)

    return check


def unusable(column: str, *words: str, **expected: Any) -> Callable[[object], None]:
    """Checks that a recording is read as `expected`, and that `column` is refused with those words when asked for."""

    def check(run: object) -> None:
        assert isinstance(run, Recording)
        for name, values in expected.items():
            np.testing.assert_allclose(run.times if name == "t" else run.column(name), values)
        assert all(word in str(run.unusable[column]) for word in words), run.unusable[column]

    return check
