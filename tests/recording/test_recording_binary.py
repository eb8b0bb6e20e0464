"""A Parquet or NetCDF recording loads to SI by header or attribute, and what is no column of numbers is refused."""

import gc
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pandas
import pytest
import xarray
from file_examples import WRITERS, U
from threads import same_in_threads

from jaxsub.errors import InputError
from jaxsub.recording import load


def refusal(path, column=None):
    """The message, less the path, of loading a file or of asking it for a column that others may do without."""
    run = load(path) if column else None
    with pytest.raises(InputError) as caught:
        run.column(column) if run else load(path)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert len(message.splitlines()) == 1
    return message.removeprefix(str(path))


def test_parquet_takes_integers_flags_and_nulls(tmp_path):
    frame = pandas.DataFrame({"t[ms]": [0, 1000], "n": pandas.array([None, 2], "Int64"), "on": [True, False]})
    frame.to_parquet(tmp_path / "run.parquet")
    run = load(tmp_path / "run.parquet")
    assert np.array_equal(run.times, [0.0, 1.0])
    np.testing.assert_array_equal(run.column("n"), [np.nan, 2.0])
    assert np.array_equal(run.column("on"), [1.0, 0.0])


@pytest.mark.parametrize("column", [["a", "b"], pandas.to_datetime(["2020-01-01", "2020-01-02"]), [[1.0], [2.0]]])
def test_parquet_column_that_is_not_numbers_is_refused_when_asked_for(tmp_path, column):
    path = tmp_path / "run.parquet"
    pandas.DataFrame({"t": [0.0, 1.0], "label": column}).to_parquet(path)
    assert refusal(path, "label").startswith((", column 'label': holds ", ", row 2, column 'label': "))


def test_netcdf_unit_is_an_attribute_and_its_time_counts_from_anywhere(tmp_path):
    path = tmp_path / "run.nc"
    variables = {"r": ("t", [180.0, np.nan], {"units": "deg s-1"}), "z[cm]": ("t", [100.0, 200.0])}
    coordinate = {"t": ("t", [0.0, 30.0], {"units": "minutes since 2020-01-01 00:00"})}
    xarray.Dataset(variables, coordinate).to_netcdf(path, engine="h5netcdf")
    run = load(path)
    assert np.array_equal(run.times, [0.0, 1800.0])
    np.testing.assert_allclose(run.column("r"), [np.pi, np.nan])
    np.testing.assert_allclose(run.column("z"), [1.0, 2.0])


def test_netcdf_time_may_be_a_variable_on_another_dimension(tmp_path):
    path = tmp_path / "run.nc"
    xarray.Dataset({"t": ("obs", [0.0, 1.0]), "u": ("obs", [3, 4])}).to_netcdf(path, engine="h5netcdf")
    assert np.array_equal(load(path).column("u"), [3.0, 4.0])


@pytest.mark.parametrize(
    ("variable", "message"),
    [
        (("t", ["a", "b"]), ", row 2, column 'x': 'a' is not a number; "),
        (((), 1.0), ", variable 'x': runs along nothing, its times along 't'; "),
        (("other", [1.0, 2.0, 3.0]), ", variable 'x': runs along 'other', its times along 't'; "),
        (("other", [1.0, 2.0]), ", variable 'x': runs along 'other', its times along 't'; "),
        ((("t", "bin"), np.zeros((2, 4))), ", variable 'x': runs along 't' and 'bin', its times along 't'; "),
        (("t", [1.0, 2.0], {"units": "knts"}), ", header 'x[knts]': unknown unit 'knts'; "),
    ],
)
def test_netcdf_variable_that_is_no_column_is_refused_when_asked_for(tmp_path, variable, message):
    path = tmp_path / "run.nc"
    xarray.Dataset({"x": variable}, {"t": [0.0, 1.0]}).to_netcdf(path, engine="h5netcdf")
    assert refusal(path, "x").startswith(message)


def test_hdf5_that_is_not_netcdf_loads_or_is_refused(tmp_path):
    path = tmp_path / "run.nc"
    with h5py.File(path, "w") as file:
        file["group/t"] = [0.0, 1.0]
    assert "no time column" in refusal(path)


def test_damaged_netcdf_is_refused_without_a_complaint_on_stderr(tmp_path, capsys, monkeypatch):
    path = tmp_path / "run.nc"
    xarray.Dataset({}, {"t": [0.0, 1.0]}).to_netcdf(path, engine="h5netcdf")
    path.write_bytes(path.read_bytes().replace(b"OHDR", b"ohdr"))
    complaints = []
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    assert refusal(path).startswith(": cannot be read (")
    gc.collect()
    assert not complaints
    assert capsys.readouterr() == ("", "")


def test_matlab_file_is_read_without_modules_of_the_current_folder(tmp_path):
    """Claim: a file called as a library, in the folder where the user stands, is not run."""
    WRITERS["packed.mat"](tmp_path / "run.mat")
    (tmp_path / "pymatreader.py").write_text("raise SystemExit('run')")
    read = "from jaxsub.recording import load; print(*load('run.mat').columns['u'])"
    done = subprocess.run([sys.executable, "-P", "-c", read], cwd=tmp_path, capture_output=True, text=True, check=True)
    np.testing.assert_array_equal(np.array(done.stdout.split(), float), U)


def test_matlab_files_that_end_their_reader_cost_no_other_file(tmp_path):
    """Claim: threads that read files beside some that end the process of SciPy's reader get what was written."""
    WRITERS["mat"](tmp_path / "whole.mat")
    WRITERS["packed.mat"](tmp_path / "packed.mat")
    whole = (tmp_path / "whole.mat").read_bytes()
    for place, byte in ((244, 104), (600, 234), (664, 252), (665, 40)):
        edited = whole[:place] + bytes([byte]) + whole[place + 1 :]
        (tmp_path / f"{place}.mat").write_bytes(edited)

    def read(path):
        try:
            return [load(path).columns["u"]]
        except InputError as error:
            return [np.array(str(error))]

    paths = sorted(tmp_path.glob("*.mat"))
    assert any("breaks off" in str(read(path)) for path in paths)
    same_in_threads(read, [(path,) for path in paths], rounds=3)
    np.testing.assert_array_equal(load(tmp_path / "whole.mat").columns["u"], U)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not say what a process takes")
def test_matlab_file_takes_no_more_memory_than_it_may_hold(tmp_path):
    """Claim: a cell array that claims 2³⁰ cells in some hundred bytes is refused before there is room for them."""
    WRITERS["mat"](tmp_path / "whole.mat")
    of_two, of_many = (b"\5\0\0\0\b\0\0\0\1\0\0\0" + count.to_bytes(4, "little") for count in (2, 2**30))
    whole = (tmp_path / "whole.mat").read_bytes()
    assert whole.count(of_two) == 1
    (tmp_path / "run.mat").write_bytes(whole.replace(of_two, of_many))
    assert "Unable to allocate 8.00 GiB" in refusal(tmp_path / "run.mat")
