"""Whatever bytes a file holds, it loads as a valid recording or is refused in one line that names it."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording import Recording, load, save

fuzz = settings(
    derandomize=True, deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def is_loaded_or_refused(path, content):
    path.write_bytes(content)
    try:
        run = load(path)
    except InputError as error:
        assert str(error).startswith(str(path))
        assert len(str(error).splitlines()) == 1
    else:
        assert np.all(np.diff(run.times) > 0)


cells = st.sampled_from(
    ["t", "t[s]", "u", "u[m/s]", "[", "]", "0", "1", "2.5", "-1e400", "nan", ",", '"', "\n", "\r", "\0", " "]
)


@fuzz
@given(
    st.binary(max_size=200)
    | st.text(max_size=80).map(str.encode)
    | st.lists(cells, max_size=30).map("".join).map(str.encode)
)
def test_any_bytes_as_csv_load_or_are_refused(tmp_path, content):
    is_loaded_or_refused(tmp_path / "run.csv", content)


@pytest.mark.parametrize("suffix", ["parquet", "nc"])
@fuzz
@given(
    edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=8),
    keep=st.sampled_from([0, 0.1, 0.5, 0.9, 1]),
)
def test_damaged_binary_file_loads_or_is_refused(tmp_path, suffix, edits, keep):
    whole = tmp_path / f"whole.{suffix}"
    if not whole.exists():
        save(Recording("run", np.arange(4.0), {"u": np.ones(4)}, "memory"), whole, {"u": "knot"})
    content = bytearray(whole.read_bytes())
    for place, byte in edits:
        content[int(place * (len(content) - 1))] = byte
    is_loaded_or_refused(tmp_path / f"run.{suffix}", bytes(content[: int(keep * len(content))]))
