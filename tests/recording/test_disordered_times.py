"""All rows whose times do not increase are counted, and the first of them listed."""

import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import Recording, load


@pytest.mark.parametrize("seed", range(5))
def test_repeated_and_backward_rows_are_counted_and_listed(seed, tmp_path):
    draws = np.random.default_rng(seed)
    rows = np.sort(draws.choice(np.arange(3, 200, 3), 12, replace=False))
    times = 0.1 * np.arange(200)
    backward = draws.uniform(size=12) < 0.5
    times[rows] = np.where(backward, times[rows - 1] - 0.05, times[rows - 1])
    (tmp_path / "run.csv").write_text("t,x\n" + "".join(f"{t!r},1\n" for t in times.tolist()))
    with pytest.raises(InputError) as error:
        load(tmp_path / "run.csv")
    said = str(error.value)
    assert f"row {2 + rows[0]}: time" in said
    assert f"of 12 such rows {12 - backward.sum()} repeat" in said and f"{backward.sum()} go back" in said
    assert f"also rows {', '.join(map(str, 2 + rows[1:6]))} and 6 more" in said


def test_one_row_is_no_list():
    with pytest.raises(InputError) as error:
        Recording("run", np.array([0.0, 1.0, 1.0, 2.0]), {}, "run.csv")
    assert "such rows" not in str(error.value) and "row 4: time 1.0 s does not come after 1.0 s" in str(error.value)
