"""A CSV recording loads to SI, or is refused in one line that names the file, the place, the fault and the remedy."""

import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import load


def load_csv(tmp_path, text):
    path = tmp_path / "run.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load(path)


def refusal(path):
    with pytest.raises(InputError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert len(message.splitlines()) == 1
    return message.removeprefix(str(path))


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_csv_in_mixed_units_with_blanks_and_a_byte_order_mark(tmp_path, newline):
    lines = ['\ufefft [ms],r[deg/s], u ,"d[cm^3]"', "0,180, 1.5,1", "500,,nan,2", "1000,-90,2e0,3", ",,,", "", ""]
    run = load_csv(tmp_path, newline.join(lines))
    np.testing.assert_allclose(run.times, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(run.column("r"), [np.pi, np.nan, -np.pi / 2])
    np.testing.assert_array_equal(run.column("u"), [1.5, np.nan, 2.0])
    np.testing.assert_allclose(run.column("d"), [1e-6, 2e-6, 3e-6])
    assert run.name == "run"


CSV_REFUSALS = {
    "empty": ("", ": is empty; "),
    "blank": (" \n\n", ": is empty; "),
    "header only": ("t,u\n", ": has 0 samples; "),
    "one row": ("t,u\n0,1\n", ": has 1 samples; "),
    "no time": ("time[s],u\n0,1\n1,2\n", ": has no time column 't'; rename 'time' to 't'"),
    "nothing like time": ("u\n0\n1\n", ": has no time column 't'; add a column headed t[s]"),
    "time in metres": ("t[m],u\n0,1\n1,2\n", ", header 't[m]': 'm' is no unit of time; "),
    "text in time": ("t,u\n0,1\n12:00,2\n", ", row 3, column 't': '12:00' is not a number; "),
    "comment": ("t,u\n0,1\n# c,1\n1,2\n", ", row 3: a comment between samples; "),
    "blank time": ("t,u\n0,1\n,2\n2,3\n", ", row 3: the time is missing or not finite; "),
    "repeated time": ("t,u\n0,1\n1,2\n1,3\n", ", row 4: time 1.0 s does not come after 1.0 s; "),
    "decreasing time": ("t,u\n5,1\n1,2\n", ", row 3: time 1.0 s does not come after 5.0 s; "),
    "long row": ("t,u\n0,1\n1,2,3\n", ", row 3: 3 cells under 2 headers; "),
    "short row": ("t,u\n0\n1,2\n", ", row 2: 1 cells under 2 headers; "),
    "blank line": ("t,u\n0,1\n\n1,2\n", ", row 3: 0 cells under 2 headers; "),
    "UTF-16 without a mark": ("t,u\n0,1\n1,2\n".encode("utf-16-le"), ": holds control characters"),
    "huge cell": ("t,u\n0," + "1" * 200_000, ": cannot be read (field larger"),
}


@pytest.mark.parametrize(("text", "message"), CSV_REFUSALS.values(), ids=CSV_REFUSALS)
def test_defective_csv_is_refused_at_its_place(tmp_path, text, message):
    path = tmp_path / "run.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    assert refusal(path).startswith(message)


CSV_UNUSABLE = {
    "text": ("t,u\n0,1\n1,fast\n", ", row 3, column 'u': 'fast' is not a number; ", "u"),
    "infinite": ("t,u\n0,1\n1,inf\n", ", row 3, column 'u': an infinite sample; ", "u"),
    "overflow": ("t,u[km]\n0,1\n1,1e307\n", ", row 3, column 'u': an infinite sample; ", "u"),
    "unit": ("t,u[knts]\n0,1\n1,2\n", ", header 'u[knts]': unknown unit 'knts'; did you mean 'knot'?", "u"),
    "twice": ("t,u,u[knot]\n0,1,1\n1,2,2\n", ": headers 'u' and 'u[knot]' name one column; ", "u"),
    "bracket": ("t,u[knot\n0,1\n1,2\n", ", column 'u[knot': cannot be a column name; ", "u[knot"),
    "underscores": ("t,u\n0,1\n1,1_000\n", ", row 3, column 'u': '1_000' is not a number; ", "u"),
}


@pytest.mark.parametrize(("text", "message", "column"), CSV_UNUSABLE.values(), ids=CSV_UNUSABLE)
def test_defective_column_is_refused_when_asked_for(tmp_path, text, message, column):
    run = load_csv(tmp_path, text)
    assert column not in run.columns
    for part in (run, run.select(run.times < 9), run.resample(run.times)):
        with pytest.raises(InputError) as caught:
            part.column(column)
        assert str(caught.value).removeprefix(run.source).startswith(message)
        assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none.csv", ": no such file; "),
        ("folder.csv", ": is a folder; "),
        ("run.doc", ": unknown extension '.doc'; use .csv, .tsv, .txt, .parquet, .nc, .mat, .xlsx, .zip"),
        ("run", ": unknown extension ''; "),
    ],
)
def test_path_that_is_no_recording_is_refused(tmp_path, name, message):
    (tmp_path / "folder.csv").mkdir()
    assert refusal(tmp_path / name).startswith(message)


def test_extension_in_capitals_is_known(tmp_path):
    (tmp_path / "RUN.CSV").write_text("t\n0\n1\n")
    assert load(tmp_path / "RUN.CSV").duration == 1.0
