"""States with a vehicle as motion model: what an outage hides, the model tells; kinematics alone drift."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked

import jaxsub as js
from jaxsub.api.dead_reckoning import dead_reckon
from jaxsub.estimate import Outage
from jaxsub.filter import Drive, KinematicProcess, Sample
from jaxsub.simulation import sampled_states
from jaxsub.vehicle import vehicle_from


def test_kinematics_of_constant_velocities_are_a_circle():
    """Claim: surge and yaw rate held lead round a circle of radius u/r, as in closed form."""
    data = {
        "schema": 1, "name": "disc", "kind": "submerged-body", "dof": ["surge", "sway", "yaw"],
        "body": {"mass": 1.0, "inertia": [1.0, 1.0, 1.0]}, "coefficients": {"X_u": -1.0},
        "outputs": {"x": {"sigma": 1.0}, "y": {"sigma": 1.0}, "psi": {"sigma": 1.0}},
    }  # fmt: skip
    vehicle = vehicle_from(data, "disc.toml")
    states = vehicle.layout.states
    process, dt, u, r = KinematicProcess(vehicle), 0.1, 2.0, 0.5
    x = jnp.array([{"u": u, "r": r}.get(name, 0.0) for name in states])
    drive = Drive(jnp.zeros((3, 1)), jnp.asarray(0.0), jnp.zeros(0))
    sample = Sample(drive, jnp.asarray(dt), jnp.zeros(3), jnp.zeros(3, bool))
    for _ in range(40):
        x = process.step(x, jnp.zeros(0), sample)
    turned, found = r * dt * 40, dict(zip(states, x, strict=True))
    np.testing.assert_allclose(found["psi"], turned, rtol=1e-9)
    np.testing.assert_allclose(found["x"], u / r * np.sin(turned), atol=1e-6)
    np.testing.assert_allclose(found["y"], u / r * (1.0 - np.cos(turned)), atol=1e-6)


def test_an_outage_is_read_from_its_text():
    """Claim: channels between commas and two times; else one line says how it is written."""
    assert Outage.of("u,v:60:120.5") == Outage(("u", "v"), 60.0, 120.5)
    for text in ("u", "u:60", "u:120:60", ":1:2:3", "u:a:b"):
        with pytest.raises(js.InputError, match="is not CHANNEL:FROM:TO"):
            Outage.of(text)


@pytest.fixture(scope="module")
def found():
    """Two runs of the oscillator, and an outage of both channels from 6 to 9 s."""
    inputs = [driven(oscillator(), 0.1 * np.arange(count), seed, amplitude=1.0) for seed, count in ((1, 120), (2, 100))]
    made = js.synthetic(oscillator(), inputs, seed=3, states=sampled_states)
    runs = [dataclasses.replace(run, name=f"run{index}") for index, run in enumerate(made)]
    return runs, dead_reckon(oscillator(), runs, outages=[Outage(("x", "x_rate"), 6.0, 9.0)])


@pytest.mark.long
def test_states_are_near_the_truth_and_their_bands_right(found):
    """Claim: against a noise-free simulation, smoothed errors are of the size of their standard deviations."""
    runs, result = found
    truth = np.asarray(sampled_states(oscillator(), stacked(oscillator(), runs), jnp.zeros((2, 2))))
    for r, track in enumerate(result.tracks):
        error = (track.smoothed - truth[r, : len(runs[r].times)])[5:]
        assert np.all(np.abs(error) < 5.0 * track.smoothed_std[5:])
        assert np.all(track.smoothed_std <= track.filtered_std + 1e-12)


@pytest.mark.long
def test_the_model_bridges_an_outage_that_kinematics_do_not(found):
    """Claim: at the end of three seconds, more than a period, the model errs by a fifth of what kinematics do."""
    _, result = found
    size = lambda name: np.sqrt(np.mean([d.error["x"] ** 2 for d in result.drifts if d.model == name]))
    assert [d.run for d in result.drifts if d.model == "model"] == ["run0", "run1"]
    assert size("model") < 0.2 * size("none")


@pytest.mark.long
def test_states_are_written_as_recordings(found, tmp_path):
    """Claim: each run's file has states with sigma and the inputs, and the JSON the drifts."""
    _, result = found
    result.save(tmp_path / "out")
    again = js.load(tmp_path / "out" / "run1.parquet")
    assert list(again.columns) == ["x_rate", "x", "sigma_x_rate", "sigma_x", "f"]
    np.testing.assert_allclose(again.column("x"), result.tracks[1].smoothed[:, 1])
    assert {one["motion_model"] for one in result.to_json()["outages"]} == {"model", "none"}
    assert "rms innovation" in result.summary()
    assert result.plot()._repr_png_()[:4] == b"\x89PNG"
