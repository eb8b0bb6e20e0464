"""The benchmarks' peers solve the problem that this library solves: same outputs, cost, gradient and curvature."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

casadi_model = pytest.importorskip("experiments.benchmarks.peers.casadi_model", exc_type=ImportError)

from experiments.benchmarks.case import problem_and_case  # noqa: E402
from experiments.benchmarks.peers import casadi_fit, scipy_fit  # noqa: E402
from experiments.benchmarks.peers.damped import minimise  # noqa: E402
from jaxsub.simulation import simulate  # noqa: E402


@pytest.fixture(scope="module")
def both():
    return problem_and_case(samples=90, runs=2)


@pytest.fixture(scope="module")
def point(both):
    return 0.02 * np.random.default_rng(4).standard_normal(both[1].size)


@pytest.fixture(scope="module")
def shown(both, point):
    """Our outputs at the point, in units of the sensors' noise."""
    problem, case = both
    vehicle, start = problem.split(jnp.asarray(point))
    return np.asarray(jax.jit(simulate)(vehicle, problem.runs, start)) / case.sigma


@eqx.filter_jit
def expand(problem, at):
    return problem.expand(at)


def casadi_outputs(case, point, *scheme):
    p = len(case.names)
    starts = case.guess + case.spread * point[p:].reshape(case.guess.shape)
    of = casadi_model.trajectory(casadi_model.Model(case, *scheme))
    runs = [of(point[:p], start, fins[:-1].T) for start, fins in zip(starts, case.fins, strict=True)]
    return np.stack([np.array(run).T for run in runs]) / case.sigma


def test_casadis_copy_of_our_step_is_our_step(both, point, shown):
    np.testing.assert_allclose(casadi_outputs(both[1], point, "etdrk4"), shown, atol=1e-8)


def test_runge_and_kuttas_step_and_ours_err_far_less_than_the_noise(both, point, shown):
    exact = casadi_outputs(both[1], point, "rk4", 16)
    assert np.abs(exact - shown).max() < 1e-3
    assert np.abs(exact - casadi_outputs(both[1], point)).max() < 3e-3


def test_scipy_gives_the_same_outputs_one_run_at_a_time_and_stacked(both, point, shown):
    case = both[1]
    stacked = scipy_fit.Stacked(case).states(point[None])[0] / case.sigma
    np.testing.assert_allclose(stacked, shown, atol=1e-3)
    np.testing.assert_allclose(scipy_fit.Serial(case).states(point, 1) / case.sigma, stacked[1], atol=1e-4)


def test_costs_gradients_and_curvatures_are_the_same(both, point):
    problem, case = both
    at = expand(problem, jnp.asarray(point))
    theirs = casadi_model.with_gradient(casadi_model.cost(casadi_model.Model(case)))(point)
    np.testing.assert_allclose(float(theirs[0]), float(at.cost), rtol=1e-4)
    size = np.sqrt(np.diag(np.asarray(at.hessian)))
    gradient, curvature = np.asarray(at.gradient) / size, np.asarray(at.hessian) / np.outer(size, size)
    near = {"rtol": 0.0, "atol": 1e-3 * np.abs(gradient).max()}
    np.testing.assert_allclose(np.array(theirs[1]).ravel() / size, gradient, **near)
    cost, slope, bend = casadi_fit.SingleShooting(casadi_model.Model(case), None).expand(point)
    np.testing.assert_allclose(cost, float(at.cost), rtol=1e-4)
    np.testing.assert_allclose(slope / size, gradient, **near)
    np.testing.assert_allclose(bend / np.outer(size, size), curvature, atol=1e-3)
    stacked = scipy_fit.Stacked(case)
    J, residual = stacked.jacobian(point), stacked.residuals(point)
    np.testing.assert_allclose(0.5 * residual @ residual, float(at.cost), rtol=1e-4)
    np.testing.assert_allclose(J.T @ J / np.outer(size, size), curvature, atol=2e-3)


def test_damped_steps_end_at_the_minimum_of_rosenbrocks_residuals():
    def expand(z):
        residual, J = np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0]]), np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0]])
        return 0.5 * residual @ residual, J.T @ residual, J.T @ J

    np.testing.assert_allclose(minimise(expand, np.array([-1.2, 1.0]), 1e-12).z, [1.0, 1.0], atol=1e-5)
