"""`js.estimate_states` takes a vehicle and recordings, and is a Kalman filter of the vehicle's model."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator

import jaxsub as js
from jaxsub.filter.defaults import DENSITY
from jaxsub.simulation import sampled_states


@pytest.fixture(scope="module")
def found():
    """Two runs of unequal length of the oscillator, filtered."""
    inputs = [driven(oscillator(), 0.1 * np.arange(count), seed, amplitude=1.0) for seed, count in ((1, 60), (2, 40))]
    made = js.synthetic(oscillator(), inputs, seed=3, states=sampled_states)
    runs = [dataclasses.replace(run, name=f"run{index}") for index, run in enumerate(made)]
    return js.estimate_states(oscillator(), runs)


def test_states_are_those_of_a_kalman_filter_written_by_itself(found):
    """Claim: in NumPy, by the matrices of the sampled plant and covariances, the same states and deviations follow."""
    plant = js.discretise(oscillator(), 0.1)
    A, B, C, _ = (np.asarray(m) for m in plant.jacobians(jnp.zeros(2), jnp.zeros(1)))
    noise, process = np.diag([0.01, 0.02]) ** 2, 0.1 * (DENSITY * np.diag([0.02, 0.01])) ** 2
    for index, run in enumerate(found.recordings):
        measured = np.stack([run.column(name) for name in ("x", "x_rate")], axis=1)
        x, P = np.array([measured[0, 1], measured[0, 0]]), np.diag([0.02, 0.01]) ** 2
        for k, z in enumerate(measured):
            if k:
                x = A @ x + B @ run.column("f")[k - 1 : k]
                P = A @ P @ A.T + process
            gain = P @ C.T @ np.linalg.inv(C @ P @ C.T + noise)
            x, P = x + gain @ (z - C @ x), P - gain @ C @ P
            np.testing.assert_allclose(found.estimates[index].x[k], x, rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(found.estimates[index].x_std[k], np.sqrt(np.diag(P)), rtol=1e-6)


def test_states_show_and_save_themselves(found, tmp_path):
    """Claim: a consistent filter's innovations have an rms near 1, each run is a recording with deviations."""
    rms = [np.sqrt(np.nanmean(found.whitened(run) ** 2)) for run in (0, 1)]
    assert all(0.7 < size < 1.3 for size in rms)
    assert "run1" in repr(found) and "x_rate" in found.summary() and "Array" not in repr(found)
    assert found.to_dataframe().loc["run0"].columns.tolist() == ["t", "x_rate", "x", "x_rate_std", "x_std"]
    found.save(tmp_path / "states")
    np.testing.assert_allclose(js.load(tmp_path / "states" / "run1.csv").column("x"), found.estimates[1].x[:, 1])
    np.testing.assert_allclose(found.to_xarray()["run0"]["x_std"], found.estimates[0].x_std[:, 1])
    assert found.plot(1)._repr_png_()[:4] == b"\x89PNG"
