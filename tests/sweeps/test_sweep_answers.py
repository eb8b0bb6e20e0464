"""The answers of a sweep are those of single fits and of SciPy, however the sweep was split."""

import json
import os
import pickle
import subprocess
import sys

import jax.numpy as jnp
import numpy as np
import pytest
from commands import environment
from scipy.optimize import least_squares
from sweep_cases import farthest, plan, recordings, vehicle

from jaxsub.errors import InputError
from jaxsub.estimate import batch, fit
from jaxsub.sweeps import OUTCOMES, answered, open_sweep, summarised, sweep

TWO_DEVICES = "--xla_force_host_platform_device_count=2"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The sweep of all tests: its folder, and what it found."""
    folder = tmp_path_factory.mktemp("sweep") / "out"
    return folder, sweep(plan(), folder)


def test_every_search_is_where_scipy_ends_from_the_same_start(done):
    problem, (_, found) = plan().problems[0], done
    for start in (5, 40):
        cell = found.isel(vehicle=0, recording=0, noise=0, start=start)
        y = plan().start_points(0, np.array([start]))[0]
        residuals = lambda y: np.asarray(problem.residuals(jnp.asarray(y)))
        by_scipy = least_squares(residuals, np.asarray(y), jac="3-point", xtol=1e-12)
        np.testing.assert_allclose(float(cell.cost), by_scipy.cost, rtol=1e-6)
        theta = np.asarray(problem.transform.to_physical(jnp.asarray(by_scipy.x[:3])))
        errors = np.asarray(cell.standard_error)
        assert np.all(np.abs(np.asarray(cell.estimate) - theta) < 0.01 * errors)
        # standard errors from SciPy's own finite differences
        covariance = np.linalg.inv(by_scipy.jac.T @ by_scipy.jac)
        scale = np.abs([float(vehicle().values()[name]) for name in found.coefficient.values])
        np.testing.assert_allclose(errors, scale * np.sqrt(np.diag(covariance)[:3]), rtol=1e-3)


def test_a_search_says_what_a_fit_says(done):
    _, found = done
    alone = fit(vehicle(), batch(vehicle(), recordings()))
    best = found.isel(vehicle=0, recording=0, noise=0, start=int(np.argmin(found.cost.values)))
    np.testing.assert_allclose(float(best.cost), float(alone.cost), rtol=1e-7)
    for name, value in alone.values.items():
        error = alone.standard_errors[name]
        own = best.sel(coefficient=name)
        np.testing.assert_allclose(float(own.standard_error), error, rtol=1e-3)
        assert abs(float(own.estimate) - value) < 0.01 * error


@pytest.mark.parametrize("width", [96, pytest.param(41, marks=pytest.mark.long)])
def test_answers_agree_however_wide_the_chunks_are(done, tmp_path, width):
    assert farthest(done[1], sweep(plan(width=[width]), tmp_path / "out")) <= 1e-9


@pytest.mark.long
def test_answers_agree_on_two_devices(done, tmp_path):
    script = f"""
import sys
sys.path[:0] = {sys.path!r}
import jax
jax.config.update("jax_enable_x64", True)
assert jax.local_device_count() == 2
from sweep_cases import plan
from jaxsub.sweeps import sweep
sweep(plan(), {str(tmp_path / "out")!r})
"""
    flags = environment(tmp_path, XLA_FLAGS=f"{os.environ.get('XLA_FLAGS', '')} {TWO_DEVICES}")
    subprocess.run([sys.executable, "-c", script], check=True, env=flags, timeout=300)
    assert farthest(done[1], open_sweep(tmp_path / "out")) <= 1e-9


def test_summary_counts_successes_basins_and_failures(done):
    _, found = done
    told = summarised(plan(), found)
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    (case,) = told["cases"]
    assert told["searches"] == told["done"] == sum(case["outcomes"].values()) == 96
    cost = found.cost.values.ravel()
    assert case["success"]["successes"] == int(np.sum(cost < np.nanmin(cost) + 0.1))
    assert sum(basin["count"] for basin in case["basins"]) + case["without_an_end"] == 96
    assert case["coefficients"]["K_x"]["file_value"] == 4.6


def test_searches_that_fail_are_masked_and_counted(tmp_path):
    # starts over the whole sky: some springs push, and the answer leaves every bound
    wild = plan(spread=4e3)
    found = sweep(wild, tmp_path / "out")
    (case,) = summarised(wild, found)["cases"]
    lost = ~np.isfinite(found.cost.values)
    assert lost.any() and case["without_an_end"] == lost.sum()
    assert case["success"]["count"] == 96 > case["success"]["successes"]
    assert set(case["outcomes"]) - {"successful"} <= set(OUTCOMES)
    assert sum(case["outcomes"].values()) == 96


def test_noise_drawn_anew_scatters_estimates_as_their_standard_errors_say(tmp_path):
    answers = {"run": answered(vehicle(), recordings())}
    drawn = plan(recordings=answers, starts=1, spread=0.05, noise=range(150), width=[150])
    found = sweep(drawn, tmp_path / "out").isel(vehicle=0, recording=0, start=0)
    scatter, claimed = found.estimate.std("noise", ddof=1), found.standard_error.mean("noise")
    # a standard deviation of 150 draws is known to 6 %
    np.testing.assert_allclose(scatter / claimed, 1.0, atol=0.25)
    truth = fit(vehicle(), batch(vehicle(), recordings())).values
    for name, value in truth.items():
        own = found.sel(coefficient=name)
        assert abs(float(own.estimate.mean()) - value) < 5.0 * float(own.standard_error.mean()) / np.sqrt(150)


def test_answers_by_compiled_code_are_the_same(done, tmp_path):
    by_c = plan(compiled=True)
    assert by_c.problems[0].march is not None
    again = pickle.loads(pickle.dumps(by_c))
    assert farthest(done[1], sweep(again, tmp_path / "out")) <= 1e-9
    with pytest.raises(InputError, match="derivatives that C has not"):
        plan(compiled=True, method="newton")
