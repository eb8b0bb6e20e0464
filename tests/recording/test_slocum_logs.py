"""A dive that a real glider recorded loads in SI; its sensors agree with one another as physics has them."""

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import Selection, contents, load

# looked for, not imported: workers that collect at the same moment would run into one another at the first import
PACKAGE = find_spec("dbdreader")
if PACKAGE is None or PACKAGE.origin is None:
    pytest.skip("needs dbdreader", allow_module_level=True)
DATA = Path(PACKAGE.origin).parent / "data"
DIVE = DATA / "ammonite-2008-028-01-000.mbd"  # Mediterranean, January 2008; the file lists its own sensors


@pytest.fixture(scope="module")
def dive():
    if not DIVE.is_file():
        pytest.skip("this dbdreader comes without examples")
    columns = {
        "z": "m_depth",
        "pressure": "m_pressure",
        "theta": "m_pitch",
        "theta_deg[deg]": "m_pitch",
        "volume": "1e-6 * m_de_oil_vol",
        "oil": "m_de_oil_vol",
        "psi": "unwrap(m_heading)",
    }
    return load(DIVE, Selection(columns, every=10.0, start=600.0), held=["oil", "volume"], interpolated=["theta"])


def test_depth_is_what_the_pressure_says(dive):
    both = ~np.isnan(dive.column("z")) & ~np.isnan(dive.column("pressure")) & (dive.column("z") > 20.0)
    assert both.sum() > 300
    ratio = dive.column("pressure")[both] / (1028.0 * 9.81 * dive.column("z")[both])
    np.testing.assert_allclose(np.median(ratio), 1.0, atol=0.02)  # bar came out as Pa


def test_stated_units_and_factors_lead_to_si(dive):
    assert 1e-4 < np.nanmax(np.abs(dive.column("oil"))) < 4e-4  # 270 cm³, in m³
    np.testing.assert_allclose(dive.column("volume"), 1e-6 * dive.column("oil"))
    assert np.nanmax(np.abs(dive.column("theta_deg"))) < np.deg2rad(1.0)  # the header's word goes before the log's
    assert not np.isnan(dive.inputs(["oil", "theta"])).any()


def test_heading_has_no_jump_of_a_turn(dive):
    psi = dive.column("psi")
    assert np.max(np.abs(np.diff(psi[~np.isnan(psi)]))) < np.pi


def test_glider_descends_while_it_points_down(dive):
    z, theta = dive.column("z"), dive.column("theta")
    rate = np.diff(z) / np.diff(dive.times)
    steep = (np.abs(theta[1:]) > 0.3) & ~np.isnan(rate) & (z[1:] > 20.0)
    assert steep.sum() > 300
    assert np.mean(np.sign(rate[steep]) == -np.sign(theta[1:][steep])) > 0.97


def test_contents_have_units_and_counts(dive):
    listed = {channel.name: channel for channel in contents(DIVE).channels}
    assert listed["m_pitch"] == ("m_pitch", "rad", 1532)
    assert listed["m_de_oil_vol"].unit == "cm^3" and "m_present_time" not in listed


@pytest.mark.parametrize("cut", [1, 5, 100_000])
def test_file_that_its_glider_did_not_close_says_so(tmp_path, cut):
    if not DIVE.is_file():
        pytest.skip("this dbdreader comes without examples")
    path = tmp_path / DIVE.name
    path.write_bytes(DIVE.read_bytes()[:-cut])
    lost = [[f.what for f in found if f.check == "incomplete-log"] for found in (
        load(path, {"z": "m_depth"}).findings, contents(path).findings, contents(DIVE).findings
    )]  # fmt: skip
    assert lost == [["is incomplete: it lacks the mark that closes it; samples may be missing"]] * 2 + [[]]


def test_sensor_list_that_is_missing_is_one_error():
    with pytest.raises(InputError, match="Cache file"):
        contents(DATA / "amadeus-2014-204-05-000.dbd")


BESIDE = """
import os, sys
made = os.makedirs
def made_by_another(*arguments, **options):
    os.makedirs = made
    made(*arguments, **options)
    raise FileExistsError(17, "File exists", *arguments)
from jaxsub.recording import contents
os.makedirs = made_by_another
print(len(contents(sys.argv[1]).channels))
assert os.makedirs is made
"""


def test_two_processes_may_be_the_first_to_read(tmp_path):
    command = [sys.executable, "-c", BESIDE, str(DIVE)]
    fresh = os.environ | {"HOME": str(tmp_path)}
    done = subprocess.run(command, env=fresh, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100
