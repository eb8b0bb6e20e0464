"""Free scales, offsets and mountings of sensors are coefficients of a fit, with errors that are what they say."""

import tomllib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

from jaxsub.estimate import batch, fit, initial_guess
from jaxsub.information import identifiability
from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import vehicle_from

RIG = """
schema = 1
name = "rig"
kind = "mechanism"
dof = ["x"]
[coefficients]
D_x = 0.5
K_x = { value = 4.0, fixed = true }
B_x_drive = { value = 2.0, fixed = true }
[inputs]
drive = { column = "u", offset = 0.1 }
[outputs.pot]
channel = "x"
column = "adc"
unit = "V"
sigma = 0.02
scale = { value = 1.5, free = true }
offset = { value = 0.0, free = true, prior_std = 2.0 }
"""
TIMES = 0.1 * np.arange(200)
TRUE = {"D_x": 0.6, "pot.scale": 1.8, "pot.offset": 0.7}


def rig(text=RIG):
    return vehicle_from(tomllib.loads(text), "rig.toml")


def recorded(vehicle, seed):
    drive = Recording("run", TIMES, {"u": 0.1 + prbs(len(TIMES), 10, 1.0, 3)}, "run")
    return synthetic(vehicle, [drive], seed=seed)


def arrays(values):
    return {name: np.asarray(value) for name, value in values.items()}


def test_errors_of_a_free_scale_and_offset_are_what_they_say():
    """Claim: over 40 seeds of noise the normalised squared errors are those of their covariance, by χ² to 1e-3."""
    fits = [fit(rig(), recorded(rig().with_values(arrays(TRUE)), seed)) for seed in range(40)]
    for name, true in TRUE.items():
        squares = sum(((one.values[name] - true) / one.standard_errors[name]) ** 2 for one in fits)
        assert 5e-4 < chi2.cdf(squares, len(fits)) < 1.0 - 5e-4, name
    assert all(0.8 < one.rms["pot"] < 1.2 for one in fits)


def test_a_scale_beside_a_free_gain_is_not_identified():
    """Claim: identifiability speaks of a sensor's numbers: of a scale and the drive's gain only the product is known.

    An offset that is near zero is known in the size of its prior.
    """
    free = rig(RIG.replace("B_x_drive = { value = 2.0, fixed = true }", "B_x_drive = 2.0"))
    found = identifiability(fit(free, recorded(rig(), 1)))
    kinds = {verdict.name: verdict.kind for verdict in found.verdicts}
    assert found.rank == len(kinds) - 1
    assert kinds["D_x"] == kinds["pot.offset"] == "identified"
    assert "identified" not in (kinds["pot.scale"], kinds["B_x_drive"])


def test_an_offset_that_no_run_tells_has_the_error_of_its_prior():
    """Claim: a compass offset beside a free initial heading: its standard error is the prior's, 0.1 rad, to 1 %."""
    text = """
schema = 1
name = "boat"
kind = "submerged-body"
dof = ["yaw"]
body = { mass = 30.0, inertia = [1.0, 3.0, 3.0] }
coefficients = { N_r = -5.0, N_delta_r = -3.0 }
inputs = { rudder = "u" }
outputs.r = { sigma = 0.003 }
[outputs.compass]
channel = "psi"
frame = "ENU"
sigma = 0.01
offset = { value = 0.0, free = true, prior_std = 0.1 }
"""
    found = fit(rig(text), recorded(rig(text), 2))
    assert found.standard_errors["compass.offset"] == pytest.approx(0.1, rel=0.01)


def test_a_free_offset_of_an_input_is_found():
    """Claim: a drive that is 0.15 off its column is found within three errors, where the reading has no offset."""
    text = RIG.replace("offset = 0.1", "offset = { value = 0.0, free = true }").replace(
        "value = 1.5, free", "value = 1.5, fixed"
    )
    text = text.replace("value = 0.0, free = true, prior_std = 2.0", "value = 0.0")
    found = fit(rig(text), recorded(rig(text).with_values(arrays({"drive.offset": 0.15})), 1))
    assert found.standard_errors["drive.offset"] < 0.01
    assert abs(found.values["drive.offset"] - 0.15) < 3.0 * found.standard_errors["drive.offset"]


@pytest.mark.parametrize("channel", ["z", "depth", "pressure"])
@pytest.mark.parametrize("line", [pytest.param("", marks=pytest.mark.long), "\nscale = 2.0\noffset = 30.0"])
def test_the_first_samples_give_the_initial_state_in_any_form(channel, line):
    """Claim: depth and heading begin where raw columns say, by the sensors' numbers."""
    text = f"""
schema = 1
name = "boat"
kind = "submerged-body"
body = {{ mass = 30.0 }}
coefficients = {{ N_r = -5.0 }}
[outputs.cell]
channel = "{channel}"{line}
[outputs.compass]
channel = "psi"
frame = "ENU"
offset = 0.2
[outputs.gps]
channel = ["latitude", "longitude"]
origin = [0.8, 0.1]
"""
    boat = vehicle_from(tomllib.loads(text), "boat.toml")
    begun = {"psi": 0.4, "x": 300.0, "y": -200.0, "z": 55.0}
    state = jnp.asarray([begun.get(name, 0.0) for name in boat.layout.states])
    (run,) = synthetic(boat, [Recording("run", TIMES, {}, "run")], seed=0, start=state[None])
    guess, _ = initial_guess(boat, batch(boat, [run]))
    found = dict(zip(boat.layout.states, np.asarray(jax.device_get(guess))[0], strict=True))
    for name, value in begun.items():
        assert found[name] == pytest.approx(value, rel=1e-6), name
