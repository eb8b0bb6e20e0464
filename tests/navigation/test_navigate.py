"""From raw sensors of a known motion: the motion, with bands that hold it, through the library and the command."""

import json

import numpy as np
import pytest
from commands import ran
from navigate_cases import SENSORS, columns
from test_sensor_files import suite_of

from jaxsub.navigation.consistency import consistency
from jaxsub.navigation.navigate import navigate
from jaxsub.navigation.suite.log import sensor_log
from jaxsub.recording import Recording, load, save

# one program for all: a delay of the DVL is estimated
TEXT = SENSORS.format(rule="constant", more="").replace("sigma = 0.02", 'sigma = 0.02\ndelay = "estimate"')
TIMES = 0.02 * np.arange(1000)
LATE = 0.12
WRAPPED = slice(0, 3)


@pytest.fixture(scope="module")
def found():
    """Truth and navigation of two dives of 20 s."""
    made = [columns(seed, TIMES, {"dvl": LATE}, usbl=0.5) for seed in (1, 2)]
    suite = suite_of(TEXT)
    return [(truth, navigate(sensor_log(Recording("dive", TIMES, log, "dive"), suite), suite)) for truth, log in made]


def errors(truth, track):
    exact = np.concatenate([truth.angles, truth.body_velocity, truth.position], axis=1)
    apart = np.asarray(track.motion) - exact
    apart[:, WRAPPED] = (apart[:, WRAPPED] + np.pi) % (2.0 * np.pi) - np.pi
    return apart


def test_the_bands_hold_the_truth(found):
    """Claim: errors of attitude, velocity and position over their deviations have an rms between 0.4 and 2."""
    for of in ("filtered", "smoothed"):
        ratio = [errors(t, getattr(n, of))[250:] / np.asarray(getattr(n, of).motion_std)[250:] for t, n in found]
        sizes = np.sqrt(np.mean(np.concatenate(ratio) ** 2, axis=0))
        assert (sizes > 0.4).all() and (sizes < 2.0).all(), (of, sizes)


def test_innovations_are_as_large_as_stated(found):
    """Claim: NIS of DVL, pressure and USBL lie within a quarter of one, or three deviations; none is refused."""
    for _, navigation in found:
        sensors = {one.name: one for one in consistency(navigation)}
        for name in ("dvl", "pressure", "usbl"):
            one = sensors[name]
            # its 95 % band is four deviations wide
            assert abs(one.nis - 1.0) < max(0.25, 0.75 * (one.high - one.low)) and one.rejected == 0, one
            assert abs(one.correlation) < 2.0 * one.bound


def test_smoothing_makes_errors_smaller(found):
    """Claim: position and velocity errors of the smoother are a tenth below the filter's, and none is above."""
    rms = lambda of: np.sqrt(np.mean([errors(t, getattr(n, of))[:, 3:] ** 2 for t, n in found], axis=(0, 1)))
    share = rms("smoothed") / rms("filtered")
    assert (share < 1.0).all() and share.mean() < 0.9


def test_a_delay_is_found_with_its_standard_error(found):
    """Claim: a Doppler log that is 0.12 s late is found to be, within four standard errors of less than 10 ms."""
    for _, navigation in found:
        track = navigation.smoothed
        value, std = (np.asarray(part)[-1, -1] for part in (track.constants, track.constants_std))
        assert std < 0.01 and abs(value - LATE) < 4.0 * std, (value, std)


def test_the_command_writes_what_the_library_finds(found, tmp_path, monkeypatch, capsys):
    """Claim: `navigate` writes a recording of channels with sigma and the log's other columns."""
    truth, log = columns(1, TIMES, {"dvl": LATE}, usbl=0.5)
    log["delta_r"] = np.sin(TIMES)
    save(Recording("dive", TIMES, log, "dive"), tmp_path / "dive.csv")
    (tmp_path / "sensors.toml").write_text(TEXT)
    true = dict(zip(("phi", "theta", "psi"), truth.angles.T, strict=True)) | {"x": truth.position[:, 0]}
    save(Recording("truth", TIMES, true, "truth"), tmp_path / "truth.csv")
    more = ("--out", tmp_path / "out", "--reference", tmp_path / "truth.csv", "--json")
    arguments = (tmp_path / "dive.csv", "--sensors", tmp_path / "sensors.toml", *more)
    code, said = ran(monkeypatch, capsys, "navigate", *arguments)
    assert code == 0, said.err
    run, content = load(tmp_path / "out" / "navigation.parquet"), json.loads(said.out)
    assert content == json.loads((tmp_path / "out" / "navigation.json").read_text())
    rms = np.sqrt(np.mean(errors(truth, found[0][1].smoothed) ** 2, axis=0))
    np.testing.assert_allclose([content["errors"][n]["rms"] for n in ("phi", "theta", "psi", "x")], rms[[0, 1, 2, 6]])
    page = (tmp_path / "out" / "report.html").read_text()
    assert all(f"<th>{name}</th>" in page for name in ("dvl", "usbl", "gyro_bias_x")) and 'src="http' not in page
    motion = np.asarray(found[0][1].smoothed.motion)
    for i, name in enumerate(("phi", "theta", "psi", "u", "v", "w", "x", "y", "z")):
        apart = run.column(name) - motion[:, i]
        np.testing.assert_allclose(np.sin(apart) if i < 3 else apart, 0.0, atol=1e-6)
        assert (run.column(f"sigma_{name}") > 0.0).all()
    rates = np.stack([run.column(name) for name in "pqr"], axis=1) - truth.rate
    assert np.sqrt(np.mean((rates / np.stack([run.column(f"sigma_{n}") for n in "pqr"], axis=1)) ** 2)) < 1.2
    np.testing.assert_allclose(run.column("delta_r"), np.sin(TIMES), atol=1e-12)
    assert content["constants"]["delay_dvl"]["unit"] == "s"
    assert {sensor["name"] for sensor in content["sensors"]} == {"magnetometer", "dvl", "pressure", "usbl"}
    (tmp_path / "sensors.toml").write_text(TEXT.replace('"du"', '"dx"'))
    code, said = ran(monkeypatch, capsys, "navigate", *arguments, "--overwrite")
    assert code == 2 and said.err.count("\n") == 1 and "no column 'dx'" in said.err
