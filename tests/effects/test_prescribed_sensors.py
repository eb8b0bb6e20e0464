"""Errors of a sensor by whose recording a vehicle moves, such as a glider's pitch."""

import tomllib

import numpy as np
import pytest

import jaxsub as js
from jaxsub.effects import SensorBias, SensorDelay, SensorDrift, SensorScale, with_numbers
from jaxsub.errors import InputError
from jaxsub.vehicle import catalogue, vehicle_from, vehicle_text

T = 4.0 * np.arange(200)


def dive(seed, pitch=lambda theta: theta):
    """A glider's dive and climb; `pitch` is what its sensor makes of the attitude."""
    rng = np.random.default_rng(seed)
    down = np.where(0.5 * T[-1] > T, 1.0, -1.0)
    smooth = np.convolve(down, np.ones(9) / 9, mode="same")
    theta = -0.35 * smooth * (1.0 + 0.3 * np.sin(0.02 * T + rng.uniform(0.0, 6.0)))
    columns = {"vbd": -2e-4 * smooth, "pitch": pitch(theta), "roll": np.zeros(len(T))}
    return js.Recording(f"dive {seed}", T, columns, "a glider")


def moved(vehicle, pitch=lambda theta: theta):
    (run,) = js.synthetic(vehicle, [dive(1, pitch)], seed=0, noise=False)
    return run.column("z")


@pytest.mark.parametrize(
    ("effect", "recorded"),
    [
        (with_numbers(SensorBias("theta"), {"bias": 0.03}), lambda theta: theta + 0.03),
        (with_numbers(SensorScale("theta"), {"scale": 0.1}), lambda theta: 1.1 * theta),
        (with_numbers(SensorDrift("theta"), {"drift": 1e-4}), lambda theta: theta + 1e-4 * T),
    ],
)
def test_vehicle_with_the_error_moves_by_the_attitude_that_was_true(effect, recorded):
    """Claim: by the wrong recording as the plain vehicle by the right one, to 1e-6 m."""
    plain = catalogue.seaglider()
    true = moved(plain)
    np.testing.assert_allclose(moved(plain.with_effect(effect), recorded), true, atol=1e-6)
    assert np.abs(moved(plain, recorded) - true).max() > 1.0


def test_file_keeps_it_and_refuses_one_that_remembers():
    plain = catalogue.seaglider()
    biased = plain.with_effect(with_numbers(SensorBias("theta"), {"bias": 0.03}))
    again = vehicle_from(tomllib.loads(vehicle_text(biased)), "glider")
    assert [effect.label for effect in again.effects] == ["sensor-bias[theta]"]
    text = vehicle_text(plain.with_effect(SensorDelay("theta", tau=np.asarray(1.0))))
    with pytest.raises(InputError, match="theta, which is prescribed"):
        vehicle_from(tomllib.loads(text), "glider")


def test_bias_of_a_prescribed_pitch_is_named():
    """Claim: 1.7° left out of the file are named at that sensor, within three standard errors of their size."""
    wrong = lambda theta: theta + 0.03
    glider = catalogue.seaglider()
    runs = [dive(seed) for seed in (1, 2, 3)]
    logs = js.synthetic(glider, runs, seed=7)
    recorded = [
        js.Recording(log.name, log.times, {**log.columns, "pitch": wrong(log.column("pitch"))}, log.source)
        for log in logs
    ]
    found = js.diagnose(glider, recorded[:2], recorded[2:])
    assert [physics.label for physics in found.physics] == ["sensor-bias[theta]"]
    estimate = found.physics[0].parameters["bias"]
    assert abs(estimate.value - 0.03) < 3.0 * estimate.standard_error
