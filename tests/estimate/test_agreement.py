"""All estimators that converge end at one optimum, on data that determine it, whatever each knows of the cost."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked

from jaxsub.estimate import METHODS, Chain, Global, Problem, basins, fit, gauss_newton, mekf, scattered, success
from jaxsub.estimate.method import Iterative
from jaxsub.estimate.simplex import NelderMead
from jaxsub.results import RESULTS
from jaxsub.simulation import synthetic
from jaxsub.vehicle.catalogue import dsrv

# half a millionth of the cost away is a thousandth of a standard error
CLOSE = 1e-6


@pytest.fixture(scope="module")
def problem():
    """Heave and pitch of the DSRV, two runs from a known start; damping and control are free."""
    vehicle = dsrv()
    inputs = [driven(vehicle, 0.25 * np.arange(80), seed=s, amplitude=0.15, hold=6) for s in (1, 2)]
    runs = stacked(vehicle, synthetic(vehicle, inputs, seed=3))
    sigma = jnp.array([output.sigma for output in vehicle.layout.outputs])
    start = jnp.zeros((2, runs.times.ndim + 2))
    return Problem.of(vehicle, runs, sigma, start, known_start=True)


@pytest.fixture(scope="module")
def best(problem):
    """The optimum that Gauss–Newton finds."""
    return gauss_newton(1e-12).run(problem, scattered(problem, 0.2, 1, seed=4))


SURE = {name: METHODS[name] for name in ("newton", "newton_eq10", "gradient")}
SURE["nelder_mead"] = lambda: Iterative(NelderMead(1e-13), 40_000)
SURE["mekf, then gauss_newton"] = lambda: Chain(mekf(), gauss_newton())
SURE["global"] = lambda: Global(gauss_newton(), span=0.8, generations=40)


LONG = {"newton_eq10", "gradient", "mekf, then gauss_newton"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.long] if n in LONG else []) for n in SURE])
def test_estimator_ends_at_the_optimum(problem, best, name):
    start = scattered(problem, 0.2, 1, seed=9)
    found = SURE[name]().run(problem, start)
    assert np.asarray(found.result == RESULTS.successful).all() or name == "gradient"
    assert float(found.cost[0]) - float(best.cost[0]) < CLOSE * float(best.cost[0])
    errors = np.sqrt(np.diag(np.linalg.inv(problem.expand(best.y[0]).hessian)))
    np.testing.assert_array_less(np.abs(found.y[0] - best.y[0]) / errors, 0.05)
    assert np.abs(start[0] - best.y[0]).max() > 0.05, "the start was meant to be away"


@pytest.mark.parametrize("name", ["ekf", pytest.param("mekf", marks=pytest.mark.long)])
def test_filter_ends_nearer_than_it_began_and_says_nothing_of_an_optimum(problem, best, name):
    starts = scattered(problem, 0.5, 6, seed=5)
    found = METHODS[name]().run(problem, starts)
    assert np.isfinite(found.cost).all()
    began, ended = np.abs(starts - best.y[0]), np.abs(found.y - best.y[0])
    assert np.median(ended) < 0.4 * np.median(began)
    assert (np.asarray(found.cost) >= float(best.cost[0]) - 1e-9).all()


def test_fit_by_any_method_is_the_same_fit(problem):
    vehicle = problem.split(scattered(problem, 0.2, 1, seed=6)[0])[0]
    known = {"start": problem.guess, "known_start": True}
    by = {name: fit(vehicle, problem.runs, method=METHODS[name](), **known) for name in ("gauss_newton", "newton")}
    one, other = by.values()
    for name, value in one.values.items():
        assert abs(value - other.values[name]) < 0.01 * one.standard_errors[name]
    np.testing.assert_allclose(one.covariance, other.covariance, rtol=1e-3)


def test_known_start_is_taken_for_the_truth_and_tells_more(problem):
    vehicle = problem.vehicle
    known = fit(vehicle, problem.runs, start=problem.guess, known_start=True)
    free = fit(vehicle, problem.runs)
    np.testing.assert_array_equal(known.start, problem.guess)
    for name in known.names:
        assert known.standard_errors[name] < free.standard_errors[name]


def test_parameter_that_is_held_stays_where_it_is(problem):
    moving = jnp.asarray([row.name != "Z_q" for row in problem.vehicle.layout.free])
    held = dataclasses.replace(problem, moving=moving)
    start = scattered(problem, 0.2, 3, seed=7)
    found = gauss_newton().run(held, start)
    np.testing.assert_array_equal(held.split(found.y[0])[0].values()["Z_q"], problem.vehicle.values()["Z_q"])
    assert np.ptp(np.asarray(found.cost)) < 1e-3


def test_rates_and_basins_count_what_failed(problem, best):
    starts = scattered(problem, 0.2, 5, seed=8).at[4].set(jnp.nan)
    found = gauss_newton().run(problem, starts)
    rate = success(found, float(best.cost[0]))
    assert (rate.successes, rate.count) == (4, 5)
    assert rate.interval[0] < 0.8 < rate.interval[1]
    clusters, lost = basins(problem, found)
    assert lost == 1
    assert [basin.count for basin in clusters] == [4]
    assert np.flatnonzero(np.asarray(found.result == RESULTS.nan_start)).tolist() == [4]
