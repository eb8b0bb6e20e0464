"""Synthetic recordings are loaded ones in all but origin: the model's outputs, its inputs, noise of a known size."""

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven, oscillator

from jaxsub.errors import InputError
from jaxsub.recording import Recording, load, save
from jaxsub.simulation import at_rest, sampled_states, synthetic
from jaxsub.vehicle import vehicle_from
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii


def inputs(vehicle, samples=400, seed=1):
    return driven(vehicle, 0.1 * np.arange(samples), seed, amplitude=1.0)


def test_noise_has_the_size_the_vehicle_file_gives_it_and_is_white():
    vehicle = oscillator()
    (clean,), (noisy,) = (synthetic(vehicle, [inputs(vehicle)], seed=3, noise=noise) for noise in (False, True))
    for channel, sigma in (("x", 0.01), ("x_rate", 0.02)):
        error = noisy.column(channel) - clean.column(channel)
        assert abs(error.std() / sigma - 1.0) < 4.0 / np.sqrt(2 * 400)
        assert abs(error.mean()) < 4.0 * sigma / np.sqrt(400)
        assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4.0 / np.sqrt(400)


def test_noise_is_that_of_the_seed_and_of_the_place_in_the_list():
    vehicle = oscillator()
    make = lambda seed, *samples: synthetic(vehicle, [inputs(vehicle, n) for n in samples], seed=seed)
    first, second = make(5, 40, 40)
    again = make(5, 40, 60)
    # bit by bit where nothing moves; motions of two shapes are two programs, which may round differently
    still = lambda _, runs, start: jnp.zeros((*runs.times.shape, start.shape[1]))
    noise = lambda *samples: synthetic(vehicle, [inputs(vehicle, n) for n in samples], seed=5, states=still)[0]
    np.testing.assert_array_equal(noise(40, 40).column("x"), noise(40, 60).column("x"))
    assert noise(40, 40).column("x").std() > 0.005
    np.testing.assert_allclose(first.column("x"), again[0].column("x"), rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(second.column("x")[:30], again[1].column("x")[:30], atol=0.1)
    assert not np.array_equal(first.column("x"), second.column("x"))
    assert not np.array_equal(first.column("x"), make(6, 40, 40)[0].column("x"))


def test_channel_whose_noise_is_to_be_estimated_has_none():
    vehicle = coupled()
    (clean,), (noisy,) = (synthetic(vehicle, [inputs(vehicle, 20)], seed=1, noise=noise) for noise in (False, True))
    np.testing.assert_array_equal(clean.column("b_rate"), noisy.column("b_rate"))
    assert not np.array_equal(clean.column("b"), noisy.column("b"))


def test_columns_are_inputs_and_channels_which_load_back_from_a_file(tmp_path):
    vehicle = dsrv()
    (made,) = synthetic(vehicle, [inputs(vehicle, 20)], seed=1, states=sampled_states)
    assert isinstance(made, Recording)
    assert set(made.columns) == {"delta_s", "w", "q", "theta", "z"}
    np.testing.assert_array_equal(made.column("delta_s"), inputs(vehicle, 20).column("delta_s"))
    save(made, tmp_path / "made.csv")
    np.testing.assert_array_equal(load(tmp_path / "made.csv").column("q"), made.column("q"))


def test_run_starts_at_rest_at_the_operating_speed():
    vehicle = nps_auv_ii()
    assert at_rest(vehicle, 3).shape == (3, 10)
    (made,) = synthetic(vehicle, [inputs(vehicle, 5)], seed=1, noise=False, states=sampled_states)
    first = {name: made.column(name)[0] for name in vehicle.layout.channels}
    assert first == dict.fromkeys(vehicle.layout.channels, 0.0) | {"u": 1.832}


def test_prescribed_motion_that_is_measured_too_stays_as_recorded():
    vehicle = vehicle_from(
        {
            "schema": 1, "name": "glider", "kind": "submerged-body", "dof": ["surge", "heave"],
            "body": {"mass": 50.0, "speed": 0.3}, "coefficients": {"X_u": -5.0, "Z_w": -80.0},
            "prescribed": {"theta": "theta"}, "outputs": {"theta": {"sigma": 0.1}, "w": {"sigma": 0.01}},
        },
        "glider.toml",
    )  # fmt: skip
    (made,) = synthetic(vehicle, [inputs(vehicle, 20)], seed=1, states=sampled_states)
    np.testing.assert_array_equal(made.column("theta"), inputs(vehicle, 20).column("theta"))


def test_run_that_diverges_or_lacks_an_input_is_refused():
    unstable = oscillator(coefficients={"D_x": -900.0, "B_x_drive": 1.0})
    with pytest.raises(InputError, match=r"^run 1: the vehicle's answer diverges by .* s; check the signs"):
        synthetic(unstable, [inputs(unstable, 60)], seed=1)
    empty = Recording("run", np.arange(5.0), {"g": np.zeros(5)}, "run.csv")
    with pytest.raises(InputError, match=r"^run\.csv: has no column 'f'"):
        synthetic(oscillator(), [empty], seed=1)
