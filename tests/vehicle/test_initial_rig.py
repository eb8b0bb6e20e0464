"""A rig that is begun from the columns of its log."""

import tomllib

import numpy as np
import pytest
from rigs import driven, oscillator

import jaxsub as js
from jaxsub.errors import InputError
from jaxsub.recording import Recording
from jaxsub.simulation import synthetic
from jaxsub.vehicle import rig_file


def logged(noise):
    """The oscillator's log by quiet sensors: x, its rate, the drive f, and what a rig has no use for."""
    vehicle = oscillator(inputs={"drive": "force"})
    (run,) = synthetic(vehicle, [driven(vehicle, 0.05 * np.arange(400), seed=1, amplitude=1.0)], seed=2, noise=False)
    rng = np.random.default_rng(3)
    columns = {name: values + noise * rng.standard_normal(400) * (name == "x") for name, values in run.columns.items()}
    return Recording("run", run.times, columns | {"status": np.ones(400), "two words": run.times}, "run.csv")


def test_a_rig_has_the_numbers_of_its_log():
    """Claim: damping, stiffness and gain are the simulated rig's to 25 %, and columns are what their names say."""
    text, unused = rig_file(logged(1e-5))
    vehicle = js.vehicle_from(tomllib.loads(text), "rig.toml")
    values = {name: float(value) for name, value in vehicle.values().items()}
    assert (values["I_x"], vehicle.layout.held, vehicle.layout.channels) == (1.0, ("force",), ("x", "x_rate"))
    for name, true in {"D_x": 0.6, "K_x": 4.0, "B_x_force": 2.0}.items():
        assert values[name] == pytest.approx(true, rel=0.25), name
    rows = {row.name: row for row in vehicle.layout.free}
    assert rows["K_x"].prior_std == pytest.approx(abs(values["K_x"]), rel=1e-3)
    assert sorted(unused) == ["status", "two words"]


def test_damping_is_that_of_a_rig_that_dissipates():
    """Claim: a log that grows, as a decay does which begins with a push by hand, gives the size with the other sign."""
    t = 0.05 * np.arange(400)
    text, _ = rig_file(Recording("run", t, {"x": np.exp(0.1 * t) * np.sin(2.0 * t)}, "run.csv"))
    found = tomllib.loads(text)["coefficients"]["D_x"]
    assert found["value"] == pytest.approx(0.2, rel=0.05)


def test_units_say_what_drives_a_rig_whatever_its_name():
    log = logged(0.0)
    renamed = {{"force": "c"}.get(name, name): values for name, values in log.columns.items()}
    text, _ = rig_file(Recording("run", log.times, renamed, "run.csv", units={"c": "N"}))
    assert 'c = "c"' in text and "I_c" not in text


@pytest.mark.parametrize(
    ("columns", "said"),
    [({"u": np.arange(9.0)}, "has no column of a coordinate"), ({"x": np.arange(9.0)}, "has 9 samples")],
)
def test_logs_without_a_rig_are_refused(columns, said):
    with pytest.raises(InputError, match=said):
        rig_file(Recording("run", np.arange(9.0), columns, "run.csv"))
