"""Newton by eq. 10 is the paper's step by step; the damped one finds minima from anywhere, quadratically at the end."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from rigs import oscillator, recorded
from scipy.optimize import minimize

from jaxsub.estimate.damped import Damped
from jaxsub.estimate.newton_raphson import NewtonEq10, second_order
from jaxsub.estimate.problem import Expansion
from jaxsub.likelihood import errors

SIGMA = 0.02


def eq_10(gradient, hessian, start, steps):
    """The iterates of eq. 10, written from the paper."""
    iterates = [np.array(start, float)]
    for _ in range(steps):
        g, H = np.asarray(gradient(iterates[-1])), np.asarray(hessian(iterates[-1]))
        lam = max(abs(entry) for entry in g)
        mu = 0.5 if lam > 1.0 else 1.0 / (lam + 1.0)
        iterates.append(iterates[-1] + np.linalg.solve(H + lam * np.eye(len(g)), -mu * g))
    return np.stack(iterates)


def rosenbrock(y, _=None):
    return 100.0 * (y[1] - y[0] ** 2) ** 2 + (1.0 - y[0]) ** 2


def rosenbrock_gradient(y):
    return np.array([-400.0 * y[0] * (y[1] - y[0] ** 2) - 2.0 * (1.0 - y[0]), 200.0 * (y[1] - y[0] ** 2)])


def rosenbrock_hessian(y):
    return np.array([[1200.0 * y[0] ** 2 - 400.0 * y[1] + 2.0, -400.0 * y[0]], [-400.0 * y[0], 200.0]])


Q = np.array([[3.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]])


def bowl(y, _=None):
    return 0.5 * y @ jnp.asarray(Q) @ y - y[0]


def saddle(y, _=None):
    """A saddle point at the origin, minima at (0, ±1)."""
    return y[0] ** 2 - 0.5 * y[1] ** 2 + 0.25 * y[1] ** 4


@pytest.fixture(scope="module")
def drag():
    """The paper's J of a body with drag D and drive B alone, and its first and second derivatives by hand.

    v_k = e v_{k-1} + c B f_{k-1} with e = exp(-D Δ), c = (1 - e)/D (eq. 2), and eq. 3 solved for it.
    """
    numbers = {"coefficients": {"D_x": 0.6, "B_x_drive": 2.0}, "outputs": {"x_rate": {"sigma": SIGMA}}}
    vehicle = oscillator(**numbers)
    runs = recorded(vehicle, 1, 30, 0.2, seed=3, amplitude=1.0)
    force, z, dt = np.asarray(runs.signals[0, :, 0]), np.asarray(runs.outputs[0, :, 0]), 0.2

    def cost(y, _=None):
        moved = vehicle.with_values({"D_x": y[0], "B_x_drive": y[1]})
        return jnp.sum((errors(moved, runs, jnp.zeros((1, 2))) / SIGMA) ** 2) / len(z)

    def derivatives(y):
        D, B = y
        e = np.exp(-D * dt)
        e1, e2 = -dt * e, dt**2 * e
        c, c1 = (1.0 - e) / D, -e1 / D - (1.0 - e) / D**2
        c2 = -e2 / D + 2.0 * e1 / D**2 + 2.0 * (1.0 - e) / D**3
        v = vD = vB = vDD = vDB = 0.0
        g, H = np.zeros(2), np.zeros((2, 2))
        for k in range(len(z)):
            if k > 0:
                f = force[k - 1]
                vDD, vDB = e2 * v + 2.0 * e1 * vD + e * vDD + c2 * B * f, e1 * vB + e * vDB + c1 * f
                vD, vB = e1 * v + e * vD + c1 * B * f, e * vB + c * f
                v = e * v + c * B * f
            r, s, S = z[k] - v, np.array([vD, vB]), np.array([[vDD, vDB], [vDB, 0.0]])
            g -= 2.0 * r * s / SIGMA**2 / len(z)
            H += 2.0 * (np.outer(s, s) - r * S) / SIGMA**2 / len(z)
        return g, H

    return cost, lambda y: derivatives(y)[0], lambda y: derivatives(y)[1]


def damped(fn, tolerance):
    """The damped Newton of `fn` with its exact Hessian."""
    return Damped(lambda args, y: Expansion(*second_order(lambda y, _: (fn(y, None), None), y, args)[:3]), tolerance)


def went_well(found):
    return bool(found.result == optx.RESULTS.successful)


def minimise(fn, solver, start, max_steps=200):
    return optx.minimise(fn, solver, jnp.asarray(start), None, max_steps=max_steps, throw=False)


def iterates(solver, fn, start, count):
    """The start and what follows it for `count` steps of the solver, whether or not it is done."""
    with_aux = lambda y, args: (fn(y), None)
    y, struct = jnp.asarray(start), jax.ShapeDtypeStruct((), float)

    def advance(carry, _):
        carry = solver.step(with_aux, carry[0], None, {}, carry[1], frozenset())[:2]
        return carry, carry[0]

    state = solver.init(with_aux, y, None, {}, struct, None, frozenset())
    return jnp.concatenate([y[None], jax.lax.scan(advance, (y, state), None, length=count)[1]])


@pytest.mark.parametrize(
    ("case", "start", "steps"),
    [("valley", [-1.2, 1.0], 25), ("quadratic", [0.5, -0.3, 0.2], 12), ("vehicle", [0.9, 1.5], 40)],
)
def test_every_iterate_is_that_of_eq_10(case, start, steps, drag):
    fn, gradient, hessian = {
        "valley": (rosenbrock, rosenbrock_gradient, rosenbrock_hessian),
        "quadratic": (bowl, lambda y: Q @ y - np.eye(3)[0], lambda y: Q),
        "vehicle": drag,
    }[case]
    expected = eq_10(gradient, hessian, start, steps)
    np.testing.assert_allclose(iterates(NewtonEq10(0.0, 0.0), fn, start, steps), expected, rtol=1e-9, atol=1e-11)


def order(left):
    """The order of convergence that the last three errors above rounding tell."""
    first, second, third = left[left > 1e-13][-3:]
    return np.log(third / second) / np.log(second / first)


def test_eq_10_is_quadratic_and_ends_where_step_and_gradient_are_small():
    path = eq_10(rosenbrock_gradient, rosenbrock_hessian, [1.3, 1.6], 40)
    short = (np.abs(np.diff(path, axis=0)) <= 1e-6 + 1e-6 * np.abs(path[1:])).all(1)
    level = [np.abs(rosenbrock_gradient(y)).max() <= 1e-6 + 1e-6 * rosenbrock(y) for y in path[:-1]]
    small = np.flatnonzero(short & level)[0]
    found = minimise(rosenbrock, NewtonEq10(1e-6, 1e-6), [1.3, 1.6])
    assert bool(found.result == optx.RESULTS.successful)
    assert found.stats["num_steps"] == small + 1
    np.testing.assert_allclose(found.value, path[small + 1], atol=1e-12)
    left = np.abs(iterates(NewtonEq10(0.0, 0.0), rosenbrock, [1.3, 1.6], 40) - 1.0).max(1)
    assert 1.8 < order(left) < 2.2


def test_eq_10_has_no_safeguard_and_its_failures_are_results():
    """It ends at a maximum; where the function has no value; and at a singular matrix: none is an exception."""
    hill = minimise(lambda y, _: jnp.cos(y[0]) + y[1] ** 2, NewtonEq10(1e-8, 1e-8), [0.3, 0.1])
    assert bool(hill.result == optx.RESULTS.successful)
    np.testing.assert_allclose(hill.value, 0.0, atol=1e-7)
    # ten steps of a half down a slope without curvature, and over its end
    away = minimise(lambda y, _: jnp.where(y[0] < 0.0, jnp.nan, 3.0 * y[0]), NewtonEq10(1e-8, 1e-8), [4.0])
    assert bool(away.result == optx.RESULTS.nonfinite)
    np.testing.assert_allclose(away.value, -0.5, atol=1e-12)
    steep = minimise(lambda y, _: jnp.exp(1e8 * y[0]), NewtonEq10(1e-6, 1e-6), [0.0], max_steps=5)
    assert bool(steep.result == optx.RESULTS.nonlinear_max_steps_reached), "a short step is no minimum"
    flat = minimise(lambda y, _: y[0] ** 2 + 0.0 * y[1], NewtonEq10(1e-8, 1e-8), [0.0, 1.0])
    assert bool(flat.result == optx.RESULTS.nonfinite)
    short = minimise(rosenbrock, NewtonEq10(1e-8, 1e-8), [-1.2, 1.0], max_steps=3)
    assert bool(short.result == optx.RESULTS.nonlinear_max_steps_reached)


def styblinski(y, _=None):
    """Many saddle points and minima, coupled."""
    return 0.5 * jnp.sum(y**4 - 16.0 * y**2 + 5.0 * y) + 0.7 * y[0] * y[1] + 0.3 * y[1] * y[2]


@pytest.mark.parametrize(
    ("fn", "start"),
    [
        (rosenbrock, [0.0, 3.0]),
        (rosenbrock, [-1.2, 1.0]),
        (bowl, [400.0, -3.0, 20.0]),
        (styblinski, [-0.1, -0.3, 0.2]),
    ],
)
def test_damped_newton_finds_the_minimum_that_scipy_finds(fn, start):
    if fn is not bowl and start[0] > -1.0:
        assert np.linalg.eigvalsh(jax.hessian(fn)(jnp.asarray(start)))[0] < 0.0, "an indefinite start was meant"
    found = minimise(fn, damped(fn, 1e-18), start)
    compiled = {"jac": jax.jit(jax.grad(fn)), "hess": jax.jit(jax.hessian(fn))}
    best = minimize(jax.jit(fn), start, method="trust-exact", options={"gtol": 1e-9}, **compiled)
    assert went_well(found)
    np.testing.assert_allclose(found.value, best.x, atol=1e-6)
    assert fn(found.value) <= best.fun + 1e-12


def test_damped_newton_never_calls_a_saddle_point_a_minimum():
    found = minimise(saddle, damped(saddle, 1e-14), [0.0, 0.0])
    assert bool(found.result == optx.RESULTS.nonlinear_divergence)
    found = minimise(saddle, damped(saddle, 1e-16), [0.3, 1e-3])
    assert went_well(found)
    np.testing.assert_allclose(np.abs(found.value), [0.0, 1.0], atol=1e-6)


def test_damped_newton_is_quadratic_at_the_end():
    left = np.abs(iterates(damped(rosenbrock, 0.0), rosenbrock, [0.0, 3.0], 40) - 1.0).max(1)
    assert 1.6 < order(left) < 2.5
    assert left[-1] < 1e-14


def test_damped_newton_of_a_vehicle_refuses_a_trial_without_value(drag):
    cost, gradient, hessian = drag
    walled = lambda y, _: jnp.where(y[0] > 2.2, jnp.nan, cost(y))
    found = minimise(walled, damped(walled, 1e-16), [2.1, 1.2])
    assert went_well(found)
    np.testing.assert_allclose(gradient(np.asarray(found.value)), 0.0, atol=1e-4)
    assert np.linalg.eigvalsh(hessian(np.asarray(found.value)))[0] > 0.0
    np.testing.assert_allclose(found.value, [0.6, 2.0], rtol=0.02)


def test_damped_newton_refuses_a_lower_trial_without_derivatives():
    edge = lambda y: jnp.where(y[0] > 1.05, 0.0, 0.0 * jnp.sqrt(1.05 - y[0]))
    fn = lambda y, _=None: (y[0] ** 2 - 1.0) ** 2 + edge(y)
    beyond = jnp.array([1.1])
    assert fn(beyond) < fn(jnp.array([0.1]))
    assert not np.isfinite(jax.grad(fn)(beyond)).all()
    found = minimise(fn, damped(fn, 1e-16), [0.1])
    assert went_well(found)
    np.testing.assert_allclose(found.value, 1.0, atol=1e-6)


@pytest.mark.parametrize("safe", [False, True])
def test_searches_side_by_side_are_those_alone(safe):
    walled = lambda y, _: jnp.where(y[1] > 50.0, jnp.nan, rosenbrock(y))
    solver = damped(walled, 1e-16) if safe else NewtonEq10(1e-8, 1e-8)
    starts = np.vstack([np.random.default_rng(6).uniform(-2.0, 2.0, (6, 2)), [[0.0, 60.0]]])
    together = jax.vmap(lambda y: minimise(walled, solver, y))(jnp.asarray(starts))
    for i, start in enumerate(starts):
        alone = minimise(walled, solver, start)
        assert together.stats["num_steps"][i] == alone.stats["num_steps"]
        np.testing.assert_allclose(together.value[i], alone.value, rtol=1e-9)
    assert np.flatnonzero(np.asarray(together.result == optx.RESULTS.nonfinite)).tolist() == [6]


def test_auxiliary_output_is_that_of_the_point_returned():
    fn = lambda y, _: (rosenbrock(y), {"twice": 2.0 * y})
    found = optx.minimise(fn, NewtonEq10(1e-6, 1e-6), jnp.array([1.2, 1.3]), None, has_aux=True)
    np.testing.assert_array_equal(found.aux["twice"], 2.0 * found.value)
