"""Tables written in any dialect are read back equal or refused, and both readers of text give the same numbers."""

import functools

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording import load
from jaxsub.recording.dialect import find_dialect
from jaxsub.recording.layout import find_layout
from jaxsub.recording.text import careful_columns, quick_columns

fuzz = functools.partial(
    settings, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
FORMATS = ("r", ".3f", ".6g", ".17g", "+.2e", "d")
EXAMPLES = [150, pytest.param(10_000, marks=pytest.mark.long)]


@st.composite
def tables(draw):
    """Rows of cells as text, with a decimal point, and the numbers that they are."""
    count = draw(st.integers(2, 6))
    times = sorted(draw(st.sets(st.integers(0, 10**6), min_size=count, max_size=count)))
    width = draw(st.integers(1, 3))
    number = st.floats(-1e9, 1e9) | st.integers(-3000, 3000).map(float)
    rows = [[t / 100.0, *(draw(number) for _ in range(width))] for t in times]
    form = draw(st.sampled_from(FORMATS))
    written = [[repr(row[0]), *(_written(value, form) for value in row[1:])] for row in rows]
    return written, [[float(cell) for cell in row] for row in written]


def _written(value: float, form: str) -> str:
    if form == "r":
        return repr(value)
    return str(round(value)) if form == "d" else format(value, form)


@st.composite
def files(draw):
    """A file's bytes, the numbers of its columns, and whether it must be read."""
    cells, numbers = draw(tables())
    separator = draw(st.sampled_from(",;\t|"))
    decimal = draw(st.sampled_from(",." if separator != "," else "."))
    cells = [[cell.replace(".", decimal) for cell in row] for row in cells]
    names = ["t", "u", "v", "w"][: len(cells[0])]
    if draw(st.booleans()):
        blank = draw(st.sampled_from(["", "NaN", "NA", "null", "-", " "]))
        row, column = draw(st.integers(0, len(cells) - 1)), draw(st.integers(1, len(names) - 1))
        cells[row][column], numbers[row][column] = blank, float("nan")
    header, units = names, []
    match draw(st.integers(0, 3)):
        case 1:
            header = [f"{name} ({unit})" for name, unit in zip(names, ["s", "m/s", "m/s", "m/s"], strict=False)]
        case 2:
            units = [["s", "m/s", "m/s", "m/s"][: len(names)]]
        case 3:
            header = [f'"{name}"' for name in names]
    rows = [header, *units, *cells]
    if draw(st.booleans()):
        rows = [["", *row] if i < 1 + len(units) else [str(i), *row] for i, row in enumerate(rows)]
    if draw(st.booleans()):
        rows = [[*row, ""] for row in rows]
    if draw(st.booleans()) and len(header) > 1:
        rows = [rows[0], *([f'"{cell}"' for cell in row] for row in rows[1:])]
    lines = draw(st.sampled_from([[], ["# one, two; three"], ["% a", "// b", ""]]))
    lines = [*lines, *(separator.join(row) for row in rows), *draw(st.sampled_from([[], [""], ["", " ", separator]]))]
    if draw(st.booleans()):
        lines.insert(0, f"sep={separator}")
    newline = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    text = newline.join(lines) + draw(st.sampled_from(["", newline]))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    return text.encode(encoding), dict(zip(names, np.array(numbers).T, strict=True))


@pytest.mark.parametrize("examples", EXAMPLES)
def test_any_dialect_is_read_back_equal_or_refused(tmp_path, examples):
    path, read = tmp_path / "run.csv", []

    @fuzz(max_examples=examples)
    @given(file=files())
    def is_read_back(file):
        content, expected = file
        path.write_bytes(content)
        try:
            run = load(path)
        except InputError as error:
            assert str(error).startswith(str(path))
            read.append(False)
            return
        assert run.times.tobytes() == expected.pop("t").tobytes()
        assert set(run.columns) | set(run.unusable) == set(expected)
        for name, values in run.columns.items():
            np.testing.assert_array_equal(values, expected[name])
        read.append(len(run.unusable) == 0)

    is_read_back()
    assert np.mean(read) > 0.8  # few tables can be read in two ways


@pytest.mark.parametrize("examples", EXAMPLES)
def test_both_readers_give_the_same_numbers(tmp_path, examples):
    path, quick = tmp_path / "run.csv", []
    odd = st.sampled_from(
        ["", "1", "nan", "NaN", "inf", "1e400", "1_0", "0x1", "x", " 2 ", "NA", "1,5", "nan(2)", "+3"]
    )

    @fuzz(max_examples=examples)
    @given(file=files(), cell=odd, place=st.floats(0, 1), swap=st.booleans())
    def are_the_same(file, cell, place, swap):
        content = file[0]
        if swap:
            lines = content.split(b"\n")
            index = int(place * (len(lines) - 1))
            lines[index] = lines[index].rpartition(b",")[0] + b"," + cell.encode()
            content = b"\n".join(lines)
        path.write_bytes(content)
        try:
            dialect = find_dialect(path, "run.csv")
            layout = find_layout(dialect.rows, dialect.top, dialect.commented, dialect.separator)
        except (InputError, UnicodeDecodeError):
            assume(False)
        fast = quick_columns(path, dialect, layout)
        quick.append(fast is not None)
        if fast is None:
            return
        slow = careful_columns(path, "run.csv", dialect, layout)
        for one, other in zip(fast, slow, strict=True):
            assert one.header == other.header and one.error == other.error
            if one.header and one.error is None:
                assert np.array_equal(one.samples(""), other.samples(""), equal_nan=True)

    are_the_same()
    assert np.mean(quick) > 0.1


def test_long_file_is_read_alike_by_both_readers(tmp_path):
    path, random = tmp_path / "run.csv", np.random.default_rng(1)
    times, values = 0.01 * np.arange(30_000), random.normal(size=30_000) * 10.0 ** random.integers(-300, 300, 30_000)
    path.write_text("t,u\n" + "".join(f"{t!r},{u!r}\n" for t, u in zip(times.tolist(), values.tolist(), strict=True)))
    run = load(path)
    assert run.times.tobytes() == times.tobytes() and run.column("u").tobytes() == values.tobytes()
    with path.open("a") as file:
        file.write("300.0,x\n")
    assert "row 30002, column 'u': 'x' is not a number" in str(load(path).unusable["u"])
