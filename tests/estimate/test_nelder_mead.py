"""The simplex search is section 4.2 of the paper, sample by sample, and stops where its rule says and nowhere else."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from rigs import oscillator, recorded

from jaxsub.estimate.simplex import NelderMead
from jaxsub.likelihood import errors


def by_the_paper(J, start, size, tolerance, most=10_000):
    """Steps 1 to 8 of section 4.2: the corners, their costs, the centroid's cost at return, and all points sampled."""
    sampled = []

    def sample(point):
        sampled.append(np.array(point))
        value = float(J(point))
        return value if np.isfinite(value) else np.inf

    m = len(start)
    theta = [np.array(start, float)]
    for i in range(m):
        step = np.zeros(m)
        step[i] = size
        theta.append(theta[0] + step)
    cost = [sample(corner) for corner in theta]
    while len(sampled) < most:
        h, low = int(np.argmax(cost)), int(np.argmin(cost))
        b = sum(theta[i] for i in range(m + 1) if i != h) / m
        at_b = sample(b)
        if np.isfinite([*cost, at_b]).all() and np.sqrt(sum((c - at_b) ** 2 for c in cost) / (m + 1)) <= tolerance:
            return theta, cost, at_b, sampled
        r = 2.0 * b - theta[h]
        at_r = sample(r)
        if at_r < cost[low]:
            e = 2.0 * r - b
            at_e = sample(e)
            theta[h], cost[h] = (e, at_e) if at_e < cost[low] else (r, at_r)
        elif not all(at_r >= cost[i] for i in range(m + 1) if i != h):
            theta[h], cost[h] = r, at_r
        else:
            c = (r + b) / 2.0 if at_r < cost[h] else (theta[h] + b) / 2.0
            at_c = sample(c)
            if at_c < cost[h]:
                theta[h], cost[h] = c, at_c
            else:
                for i in range(m + 1):
                    if i != low:
                        theta[i] = (theta[i] + theta[low]) / 2.0
                        cost[i] = sample(theta[i])
    raise AssertionError("the rule was never met")


def rosenbrock(y, _):
    return jnp.sum(100.0 * (y[1:] - y[:-1] ** 2) ** 2 + (1.0 - y[:-1]) ** 2)


def bowl(y, _):
    return y @ jnp.array([[3.0, 1.0, 0.0], [1.0, 2.0, 0.5], [0.0, 0.5, 1.0]]) @ (y - 2.0)


def rough(y, _):
    """Ripples make it shrink, and a part of the plane has no value."""
    ripple = jnp.sum(y**2 + 2.0 * (1.0 - jnp.cos(25.0 * y)))
    return jnp.where(y[0] + y[1] > 1.6, jnp.nan, ripple)


def line(y, _):
    return (y[0] - 0.3) ** 4


CASES = {
    "valley": (rosenbrock, [-1.2, 1.0], 0.5, 1e-9),
    "valley of four": (rosenbrock, [-0.5, 0.8, 0.3, 0.1], 0.3, 1e-7),
    "quadratic": (bowl, [4.0, -3.0, 1.0], 1.0, 1e-10),
    "ripples and a hole": (rough, [0.17, 1.19], 0.8, 1e-8),
    "one coordinate": (line, [2.0], 0.1, 1e-12),
}


def minimise(fn, start, size, tolerance, max_steps=5000):
    solver = NelderMead(tolerance, size)
    return optx.minimise(fn, solver, jnp.asarray(start), None, max_steps=max_steps, throw=False)


def assert_as_by_the_paper(fn, start, size, tolerance):
    """The same corners at return, after as many samples, and the rule met there by costs sampled anew."""
    J = jax.jit(lambda y: fn(y, None))
    theta, cost, at_b, sampled = by_the_paper(J, start, size, tolerance)
    found = minimise(fn, start, size, tolerance)
    assert bool(found.result == optx.RESULTS.successful)
    assert found.stats["num_evaluations"] == found.stats["num_steps"] == len(sampled)
    np.testing.assert_allclose(found.state.corners, theta, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found.value, theta[int(np.argmin(cost))], rtol=1e-10, atol=1e-10)
    corners = np.asarray(found.state.corners)
    costs = np.array([J(corner) for corner in corners])
    b = np.delete(corners, np.argmax(costs), axis=0).mean(0)
    np.testing.assert_allclose(J(b), at_b, rtol=1e-9, atol=1e-15)
    assert np.sqrt(np.mean((costs - J(b)) ** 2)) <= tolerance


@pytest.mark.parametrize("name", CASES)
def test_search_ends_as_the_paper_s_list_of_steps_does(name):
    assert_as_by_the_paper(*CASES[name])


def test_search_of_a_vehicle_s_coefficients_ends_as_the_paper_s_list_of_steps_does():
    """J of a mechanism's damping, stiffness and drive."""
    vehicle = oscillator()
    runs = recorded(vehicle, 1, 30, 0.2, seed=3, amplitude=1.0)
    sigma = jnp.array([0.01, 0.02])

    def J(y, _):
        moved = vehicle.with_values({"D_x": y[0], "K_x": y[1], "B_x_drive": y[2]})
        return jnp.sum((errors(moved, runs, jnp.zeros((1, 2))) / sigma) ** 2) / runs.times.size

    assert_as_by_the_paper(J, [0.9, 3.2, 1.6], 0.2, 1e-6)


def test_every_point_sampled_is_the_paper_s_next_and_every_kind_of_step_is_among_them():
    fn, start, size, tolerance = CASES["ripples and a hole"]
    sampled = by_the_paper(jax.jit(lambda y: fn(y, None)), start, size, tolerance)[3]
    solver, y = NelderMead(tolerance, size), jnp.asarray(start)
    with_aux = lambda y, args: (fn(y, args), None)
    struct = jax.ShapeDtypeStruct((), y.dtype)
    state = solver.init(with_aux, y, None, {}, struct, None, frozenset())
    step = jax.jit(lambda y, state: solver.step(with_aux, y, None, {}, state, frozenset())[:2])
    phases = []
    for point in sampled:
        np.testing.assert_allclose(state.trial, point, rtol=1e-12, atol=1e-14)
        phases.append(int(state.phase))
        y, state = step(y, state)
        assert bool(state.done) == (len(phases) == len(sampled))
    corner, centroid, reflect, expand, contract = np.bincount(phases, minlength=5)
    assert corner > 3, "no shrink was taken"
    assert any(point.sum() > 1.6 for point in sampled), "the hole was never met"
    assert centroid == reflect + 1
    assert expand > 0
    assert contract > 0


def test_a_smaller_tolerance_comes_closer():
    errors_left = []
    for tolerance in (1e-2, 1e-5, 1e-8):
        found = minimise(rosenbrock, [-1.2, 1.0], 0.5, tolerance)
        errors_left.append(float(jnp.abs(found.value - 1.0).max()))
    assert errors_left[0] > 10.0 * errors_left[1] > 100.0 * errors_left[2]
    assert errors_left[2] < 1e-3


def test_searches_side_by_side_are_those_alone():
    starts = np.random.default_rng(4).uniform(-2.0, 2.0, (7, 2))
    together = jax.vmap(lambda y: minimise(rosenbrock, y, 0.3, 1e-8))(jnp.asarray(starts))
    counts = np.asarray(together.stats["num_evaluations"])
    assert len(set(counts.tolist())) > 3
    for i, start in enumerate(starts):
        alone = minimise(rosenbrock, start, 0.3, 1e-8)
        assert counts[i] == alone.stats["num_evaluations"]
        np.testing.assert_allclose(together.value[i], alone.value, rtol=1e-12)
    assert bool(jnp.all(together.result == optx.RESULTS.successful))


def test_failures_are_results_and_leave_the_others_alone():
    """Nowhere finite, and too few samples; the best corner so far is kept."""
    nowhere = lambda y, _: jnp.where(y[0] > 50.0, jnp.nan, rosenbrock(y, None))
    starts = jnp.array([[-1.2, 1.0], [60.0, 1.0]])
    found = jax.vmap(lambda y: minimise(nowhere, y, 0.5, 1e-8))(starts)
    assert np.asarray(found.result == optx.RESULTS.successful).tolist() == [True, False]
    assert np.asarray(found.result == optx.RESULTS.nonfinite).tolist() == [False, True]
    assert found.stats["num_evaluations"][1] == 3
    cut = minimise(rosenbrock, [-1.2, 1.0], 0.5, 1e-8, max_steps=20)
    assert bool(cut.result == optx.RESULTS.nonlinear_max_steps_reached)
    assert rosenbrock(cut.value, None) < rosenbrock(jnp.array([-1.2, 1.0]), None)


def test_auxiliary_output_is_that_of_the_point_returned():
    fn = lambda y, _: (rosenbrock(y, None), {"twice": 2.0 * y})
    found = optx.minimise(fn, NelderMead(1e-8, 0.5), jnp.array([-1.2, 1.0]), None, has_aux=True, max_steps=2000)
    np.testing.assert_array_equal(found.aux["twice"], 2.0 * found.value)
