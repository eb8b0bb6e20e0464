"""A frame or dataset becomes the recording that its file would, with the same refusals, and comes back the same."""

import numpy as np
import pandas
import pytest
import xarray

from jaxsub.errors import InputError
from jaxsub.recording import Recording, from_pandas, from_xarray, load, save, to_pandas, to_xarray

INSTANTS = ["2024-06-01 12:00:00.0", "2024-06-01 12:00:00.5", "2024-06-01 12:00:02.0"]


@pytest.fixture
def run():
    columns = {"r": np.array([0.1, np.nan, -0.3]), "delta_r": np.array([0.0, 0.2, 0.2])}
    return Recording("run", np.array([0.0, 0.5, 2.0]), columns, "memory")


@pytest.mark.parametrize(("there", "back"), [(to_pandas, from_pandas), (to_xarray, from_xarray)])
@pytest.mark.parametrize("units", [{}, {"r": "deg/s", "t": "min"}])
def test_run_comes_back_with_its_gaps_in_any_unit(run, there, back, units):
    again = back(there(run, units), "run")
    np.testing.assert_allclose(again.times, run.times, rtol=1e-15)
    assert again.columns.keys() == run.columns.keys()
    for name, values in run.columns.items():
        np.testing.assert_allclose(again.column(name), values, rtol=1e-14)


def test_frame_and_dataset_are_what_a_file_of_them_loads_as(run, tmp_path):
    save(run, tmp_path / "run.parquet", {"r": "deg/s"})
    save(run, tmp_path / "run.nc", {"r": "deg/s"})
    frame = pandas.read_parquet(tmp_path / "run.parquet")
    dataset = xarray.load_dataset(tmp_path / "run.nc", engine="h5netcdf")
    pandas.testing.assert_frame_equal(frame, to_pandas(run, {"r": "deg/s"}))
    xarray.testing.assert_identical(dataset, to_xarray(run, {"r": "deg/s"}))
    for made, path in ((from_pandas(frame), "run.parquet"), (from_xarray(dataset), "run.nc")):
        np.testing.assert_array_equal(made.column("r"), load(tmp_path / path).column("r"))


@pytest.mark.parametrize(
    "index",
    [
        pandas.Index([0.0, 500.0, 2000.0], name="t[ms]"),
        pandas.to_datetime(INSTANTS),
        pandas.to_datetime(INSTANTS, utc=True),
        pandas.to_timedelta([0.0, 0.5, 2.0], unit="s"),
    ],
    ids=["named t", "instants", "instants in UTC", "spans"],
)
def test_index_may_hold_the_time(index):
    made = from_pandas(pandas.DataFrame({"z[cm]": pandas.array([100, None, 300], "Int64")}, index=index))
    np.testing.assert_allclose(made.times, [0.0, 0.5, 2.0])
    np.testing.assert_array_equal(made.column("z"), [1.0, np.nan, 3.0])


def test_dataset_may_hold_instants():
    times = np.array(["2024-06-01T12:00:00", "2024-06-01T12:01:00"], "datetime64[ns]")
    made = from_xarray(xarray.Dataset({"depth": ("t", [1.0, 2.0], {"units": "dbar"})}, {"t": times}))
    assert np.array_equal(made.times, [0.0, 60.0])
    assert np.array_equal(made.column("depth"), [1e4, 2e4])


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (pandas.DataFrame({"time": [0.0, 1.0]}), "dive: has no time column 't'; rename 'time' to 't'"),
        (pandas.DataFrame({"r": [0.0, 1.0]}), r"dive: has no time column 't'; add a column headed t\[s\]"),
        (pandas.DataFrame({"t": [0.0, 0.0]}), "dive, row 3: time 0.0 s does not come after 0.0 s"),
        (pandas.DataFrame({"t[m]": [0.0, 1.0]}), "'m' is no unit of time"),
    ],
)
def test_bad_frame_is_refused_like_a_bad_file(frame, message):
    with pytest.raises(InputError, match=message):
        from_pandas(frame, "dive")


def test_columns_that_nobody_asks_for_are_left_alone():
    samples = {"t": [0.0, 1.0], "r[deg/s]": [0.0, 180.0], "label": ["a", None], "mode[NTU]": [1, 2]}
    made = from_pandas(pandas.DataFrame(samples | {"k[-]": [0.1, 0.2], "z": [1.0, 2.0]}), "dive")
    assert set(made.columns) == {"r", "k", "z"}
    assert set(made.unusable) == {"label", "mode"}
    assert made.units == {"r": "rad/s", "k": "1"}
    for part in (made.between(0.0, 1.0), made.resample(np.array([0.0, 0.5]))):
        assert (part.units, part.unusable) == (made.units, made.unusable)


def test_g_is_gravity_on_an_acceleration_and_gram_elsewhere():
    made = from_pandas(pandas.DataFrame({"t": [0.0, 1.0], "az[g]": [1.0, -1.0], "ax[mg]": [1, 1], "lead[g]": [1, 1]}))
    np.testing.assert_allclose(made.column("az"), [9.80665, -9.80665])
    np.testing.assert_allclose(made.column("ax"), 0.00980665)
    np.testing.assert_allclose(made.column("lead"), 1e-3)
    assert made.units == {"az": "m/s²", "ax": "m/s²", "lead": "kg"}
    written = to_pandas(made, {"az": "g", "lead": "g"})
    np.testing.assert_allclose(written["az[g]"], [1.0, -1.0])
    np.testing.assert_allclose(written["lead[g]"], 1.0)
    with pytest.raises(InputError, match=r"column 'az': is in m/s², which 'deg' is no unit of; write it in m/s²"):
        to_pandas(made, {"az": "deg"})
