"""ArduPilot's logs load as the run they hold, with the units that they state and a heading through north unwrapped."""

import ardupilot_examples as flight
import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import contents, load

pytest.importorskip("pymavlink")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ardupilot")
    return flight.dataflash(folder / "flight.bin"), flight.telemetry(folder / "flight.tlog")


def test_dataflash_has_units_instances_and_times_since_boot(logs):
    columns = {"r": "IMU[0].GyrZ", "r2": "IMU[1].GyrZ", "psi": "ATT.Yaw", "delta_r": "(RCOU.C1 - 1500) * 0.001"}
    run = load(logs[0], columns, held=["delta_r"], interpolated=["psi"])
    np.testing.assert_allclose(run.times, flight.TIMES - flight.TIMES[0], atol=1e-6)
    np.testing.assert_allclose(run.column("r"), flight.RATE, atol=1e-7)
    np.testing.assert_allclose(run.column("r2"), flight.RATE + 1.0, atol=1e-6)
    np.testing.assert_allclose(run.column("psi"), np.unwrap(np.deg2rad(flight.HEADING)), atol=1e-4)
    np.testing.assert_allclose(run.column("delta_r"), 0.001 * (flight.PWM - 1500))
    assert run.units["r"] == "rad/s"


def test_telemetry_keeps_systems_apart(logs):
    run = load(logs[1], {"r": "ATTITUDE.yawspeed", "psi": "ATTITUDE.yaw"}, interpolated=["psi"])
    np.testing.assert_allclose(run.times, flight.TIMES - flight.TIMES[0], atol=1e-5)
    np.testing.assert_allclose(run.column("r"), flight.RATE, atol=1e-7)
    assert np.max(np.abs(np.diff(run.column("psi")))) < 0.01
    listed = {channel.name: channel for channel in contents(logs[1]).channels}
    assert listed["ATTITUDE.yaw"].unit == "rad" and listed["HEARTBEAT[255.190].type"].samples == 50
    with pytest.raises(InputError, match=r"holds no channel 'HEARTBEAT.type'; did you mean 'HEARTBEAT\[1.1\].type'"):
        load(logs[1], {"x": "HEARTBEAT.type"})


@pytest.mark.parametrize("suffix", [".bin", ".tlog"])
@pytest.mark.parametrize("content", [b"nonsense" * 20, b"\xa3\x95\x80" * 40, bytes(200), b"\xa3\x95\x80\x80\x00" * 30])
def test_damaged_log_is_one_error_and_nothing_else(tmp_path, capsys, suffix, content):
    path = tmp_path / f"flight{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(path, {"r": "IMU[0].GyrZ"})
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    assert capsys.readouterr() == ("", "")
