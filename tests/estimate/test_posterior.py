"""Draws are those of the posterior: a Gaussian's where the model is nearly linear, a dense grid's where it is not."""

import importlib
import warnings

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, recorded, stacked
from scipy.linalg import expm

from jaxsub.errors import InputError
from jaxsub.estimate import fit, posterior
from jaxsub.simulation import synthetic

pytest.importorskip("numpyro")
with warnings.catch_warnings():
    warnings.simplefilter("ignore", FutureWarning)
    arviz = pytest.importorskip("arviz")


def moments(data, name):
    draws = np.asarray(data["posterior"][name])
    return draws.mean(), draws.std(), float(arviz.rhat(draws)), float(arviz.ess(draws))


@pytest.mark.long
def test_nearly_linear_case_has_the_standard_errors_of_gauss_and_newton():
    outputs = {"x": {"sigma": 0.01}, "x_rate": {"sigma": "estimate"}}
    vehicle = oscillator(outputs=outputs)
    noisy = recorded(oscillator(), 1, 60, 0.15, seed=1, amplitude=1.0)
    found = fit(vehicle, noisy)
    data = posterior(found, draws=400, warmup=150, chains=4)
    assert not np.asarray(data["sample_stats"]["diverging"]).any()
    for name in found.names:
        mean, spread, rhat, effective = moments(data, name)
        error = found.standard_errors[name]
        assert rhat < 1.02
        assert abs(mean - found.values[name]) < 0.1 * error + 4.0 * spread / np.sqrt(effective)
        # sigma's own uncertainty, 60 samples of it, widens the marginal by a hundredth
        assert abs(spread / error - 1.0) < 0.02 + 4.0 / np.sqrt(2.0 * effective)
    sigma = np.asarray(data["posterior"]["sigma"])
    assert data["posterior"]["sigma"].coords["channel"].values.tolist() == ["x_rate"]
    # of scale s with n residuals: s²ν/σ² is χ²_ν, so ln σ has a standard deviation of 1/√(2ν)
    assert abs(np.std(np.log(sigma)) * np.sqrt(2.0 * 60) - 1.0) < 0.15
    assert data["posterior"]["initial_state"].dims == ("chain", "draw", "run", "state")


@pytest.fixture(scope="module")
def loose():
    """A damper that few and noisy samples hardly tell, which may not be negative, and a spring."""
    coefficients = {"D_x": {"value": 0.3, "bounds": [0.0, 3.0]}, "K_x": 4.0, "B_x_drive": {"value": 2.0, "fixed": True}}
    vehicle = oscillator(coefficients=coefficients, outputs={"x": {"sigma": 0.4}})
    inputs = driven(vehicle, 0.2 * np.arange(16), seed=3, amplitude=1.0, hold=4)
    runs = stacked(vehicle, synthetic(vehicle, [inputs], seed=5))
    found = fit(vehicle, runs, start=jnp.zeros((1, 2)), known_start=True)
    return found, posterior(found, draws=1000, warmup=200, chains=4, seed=1)


def grid_density(found, dampers, springs):
    """exp(-½ Σ residual²) with a flat prior, by exact steps of the oscillator from rest."""
    force, z = (np.asarray(a)[0, :, 0] for a in (found.runs.signals, found.runs.outputs))
    cost = np.zeros((len(dampers), len(springs)))
    for i, damper in enumerate(dampers):
        block = np.zeros((len(springs), 3, 3))
        block[:, 0, 0], block[:, 0, 1], block[:, 0, 2], block[:, 1, 0] = -damper, -springs, 2.0, 1.0
        step = expm(0.2 * block)
        state = np.zeros((len(springs), 2))
        for k in range(len(z)):
            cost[i] += 0.5 * ((z[k] - state[:, 1]) / 0.4) ** 2
            state = np.einsum("gij,gj->gi", step[:, :2], np.column_stack([state, np.full(len(springs), force[k])]))
    density = np.exp(cost.min() - cost)
    return density / density.sum()


def test_case_of_two_parameters_has_the_moments_of_a_dense_grid(loose):
    found, data = loose
    dampers, springs = np.linspace(0.0, 3.0, 101), np.linspace(0.0, 40.0, 201)
    density = grid_density(found, dampers, springs)
    assert density[:, -1].sum() < 1e-6
    for name, values, marginal in (("D_x", dampers, density.sum(1)), ("K_x", springs, density.sum(0))):
        mean, spread, rhat, effective = moments(data, name)
        truth = values @ marginal
        width = np.sqrt((values - truth) ** 2 @ marginal)
        assert rhat < 1.02
        assert abs(mean - truth) < 4.5 * width / np.sqrt(effective)
        assert abs(spread / width - 1.0) < 0.1
        # far from normal: Gauss and Newton's intervals would not do, or the test says nothing
        quantiles = np.quantile(np.asarray(data["posterior"][name]), [0.05, 0.5, 0.95])
        # half of a cell lies below its middle
        below = np.interp(quantiles, values, np.cumsum(marginal) - 0.5 * marginal)
        np.testing.assert_allclose(below, [0.05, 0.5, 0.95], atol=4.5 * 0.5 / np.sqrt(effective) + 0.01)
    assert abs(found.values["D_x"] - dampers @ density.sum(1)) > 0.2 * np.std(np.asarray(data["posterior"]["D_x"]))


def test_draws_keep_the_bounds(loose):
    _, data = loose
    draws = np.asarray(data["posterior"]["D_x"])
    assert (draws > 0.0).all() and (draws < 3.0).all()
    assert "sigma" not in data["posterior"] and "initial_state" not in data["posterior"]


def test_direction_that_no_recording_tells_is_refused():
    vehicle = oscillator()
    still = driven(vehicle, 0.2 * np.arange(20), seed=0, amplitude=0.0)
    runs = stacked(vehicle, synthetic(vehicle, [still], seed=0, noise=False))
    found = fit(vehicle, runs, start=jnp.zeros((1, 2)), known_start=True)
    with pytest.raises(InputError, match="leave a combination of coefficients open"):
        posterior(found)


def test_missing_package_says_what_installs_it(loose, monkeypatch):
    load = importlib.import_module

    def without(name, *rest):
        if name.startswith("numpyro"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return load(name, *rest)

    monkeypatch.setattr(importlib, "import_module", without)
    with pytest.raises(InputError, match=r"needs the package numpyro.* pip install 'jaxsub\[bayes\]'"):
        posterior(loose[0])
