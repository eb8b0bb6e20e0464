"""What is saved is what is loaded: bit for bit in SI, to rounding in other units; and a failed save harms nothing."""

import numpy as np
import pandas
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jaxsub.errors import InputError
from jaxsub.recording import Recording, files, load, save

FORMATS = ("csv", "parquet", "nc")
quick = settings(
    derandomize=True, deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
names = st.from_regex(r"[^\W][^\[\]/\x00-\x1f\x7f\s]{0,8}", fullmatch=True).filter(lambda name: name != "t")


@st.composite
def recordings(draw, limit=1e308):
    times = sorted(draw(st.sets(st.floats(-limit, limit).map(lambda x: x + 0.0), min_size=2, max_size=6)))
    samples = st.lists(st.floats(-limit, limit) | st.just(np.nan), min_size=len(times), max_size=len(times))
    columns = {name: np.array(draw(samples)) for name in draw(st.sets(names, max_size=4))}
    return Recording("run", np.array(times), columns, "memory")


@pytest.mark.parametrize("suffix", FORMATS)
@quick
@given(run=recordings())
def test_saved_samples_load_bit_for_bit(tmp_path, suffix, run):
    path = tmp_path / f"run.{suffix}"
    save(run, path)
    again = load(path)
    assert (again.name, again.source) == ("run", str(path))
    assert again.times.tobytes() == run.times.tobytes()
    assert again.columns.keys() == run.columns.keys()
    for name, values in run.columns.items():
        np.testing.assert_array_equal(again.column(name), values)
        assert np.array_equal(np.signbit(again.column(name)), np.signbit(values)) or np.isnan(values).any()


@pytest.mark.parametrize("suffix", FORMATS)
@quick
@given(
    values=st.lists(st.floats(-1e6, 1e6) | st.just(np.nan), min_size=3, max_size=3),
    unit=st.sampled_from(["deg/s", "knot", "degC", "percent", "cm^3", "m s-1", "", "1"]),
    time=st.sampled_from(["ms", "min", "s"]),
)
def test_requested_units_load_back_to_rounding(tmp_path, suffix, values, unit, time):
    run = Recording("run", np.array([0.0, 0.5, 2.0]), {"a": np.array(values), "b": np.arange(3.0)}, "memory")
    path = tmp_path / f"run.{suffix}"
    save(run, path, {"a": unit, "t": time})
    again = load(path)
    np.testing.assert_allclose(again.times, run.times, rtol=1e-12)
    np.testing.assert_allclose(again.column("a"), run.column("a"), rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(again.column("b"), run.column("b"))


def make(**columns):
    return Recording("run", np.array([0.0, 1.0]), columns or {"r": np.array([np.pi, np.nan])}, "memory")


def test_csv_is_what_a_user_would_write(tmp_path):
    save(make(), tmp_path / "run.csv", {"r": "deg/s"})
    assert (tmp_path / "run.csv").read_text().split() == ["t,r[deg/s]", "0.0,180.0", "1.0,"]


def test_parquet_opens_in_pandas_with_bracketed_units(tmp_path):
    save(make(), tmp_path / "run.parquet", {"r": "deg"})
    assert list(pandas.read_parquet(tmp_path / "run.parquet").columns) == ["t", "r[deg]"]


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"R": "deg"}, "no column 'R'; did you mean 'r'"),
        ({"r": "dge"}, "unknown unit 'dge'; did you mean 'deg'"),
        ({"t": "m"}, "'m' is no unit of time"),
    ],
)
def test_units_that_do_not_fit_are_refused_before_anything_is_written(tmp_path, units, message):
    with pytest.raises(InputError, match=message):
        save(make(), tmp_path / "run.csv", units)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("target", ["run.txt", "run", "none/run.csv", "folder.csv"])
def test_path_that_cannot_be_written_is_refused(tmp_path, target):
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(InputError) as caught:
        save(make(), tmp_path / target)
    assert str(caught.value).startswith(str(tmp_path / target))
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder.csv"]


def test_name_that_netcdf_cannot_hold_is_refused(tmp_path):
    with pytest.raises(InputError, match="'V/Hz': is a name that NetCDF cannot hold"):
        save(make(**{"V/Hz": np.zeros(2)}), tmp_path / "run.nc")
    save(make(**{"V/Hz": np.zeros(2)}), tmp_path / "run.csv")
    assert "V/Hz" in load(tmp_path / "run.csv").columns


def test_failed_save_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch):
    path = tmp_path / "run.csv"
    save(make(), path)
    before = path.read_bytes()

    def write_half(target, recording, units):
        target.write_text("t,r\n0.0,")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(files._WRITERS, ".csv", write_half)
    with pytest.raises(InputError, match=r"run\.csv: cannot be written \(No space left on device\)"):
        save(make(), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_reader_of_the_old_file_is_not_disturbed_by_a_save(tmp_path):
    path = tmp_path / "run.csv"
    save(make(), path)
    before = path.read_text()
    with path.open() as reader:
        save(make(u=np.ones(2)), path)
        assert reader.read() == before
    assert path.read_text() != before
