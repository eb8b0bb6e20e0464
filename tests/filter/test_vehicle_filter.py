"""A vehicle's process is its sampled simulation, and the modified filter recovers its coefficients from far off."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from filter_cases import at
from rigs import coupled, driven, oscillator, recorded, stacked

from jaxsub.effects import ActuatorLag, QuadraticDamping, SensorScale
from jaxsub.errors import InputError
from jaxsub.filter.defaults import state_scale, vehicle_filter
from jaxsub.filter.ekf import ExtendedKalmanFilter, on_line
from jaxsub.filter.mekf import ModifiedKalmanFilter
from jaxsub.filter.model import linearised
from jaxsub.filter.passes import identify, over_runs
from jaxsub.filter.vehicle import VehicleProcess, samples
from jaxsub.recording import Recording
from jaxsub.simulation import Sampled, at_rest, synthetic
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii


@pytest.fixture(scope="module")
def body():
    """A body with a force and a sensor effect, and two uneven runs of unequal length."""
    vehicle = dsrv().with_effect(QuadraticDamping("pitch", jnp.asarray(-3e4)))
    vehicle = vehicle.with_effect(SensorScale("q", jnp.asarray(0.05)))
    spans = [0.2 * np.arange(12), np.cumsum(np.random.default_rng(2).choice([0.1, 0.3, 0.45], 8))]
    inputs = [driven(vehicle, times, seed, hold=4) for seed, times in enumerate(spans)]
    return vehicle, stacked(vehicle, synthetic(vehicle, inputs, seed=7), substeps=2)


def moved(vehicle, theta):
    """The vehicle with free numbers θ times their size away from its own."""
    names, values = [row.name for row in vehicle.layout.free], vehicle.values()
    return vehicle.with_values({n: values[n] + abs(values[n]) * t for n, t in zip(names, theta, strict=True)})


def test_the_process_is_the_sampled_simulation(body):
    vehicle, runs = body
    process, drive = VehicleProcess.of(vehicle, runs.substeps), samples(runs)
    theta = jnp.asarray(0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, len(vehicle.layout.free)))
    assert (np.asarray(drive.elapsed[:, 0]) == 0.0).all()
    assert (np.asarray(drive.elapsed[1, 8:]) == 0.0).all()
    states = jax.jit(lambda t: Sampled.of(moved(vehicle, t), runs).states(runs, jnp.zeros((2, 4))))(theta)
    shown = moved(vehicle, theta).measure(runs.times, states, runs.signals)
    step = jax.jit(lambda x, sample: process.step(x, theta, sample))
    observe = jax.jit(lambda x, sample: process.observe(x, theta, sample))
    for run, k in [(0, 1), (0, 7), (1, 4), (1, 7)]:
        sample = at(drive, run, k)
        np.testing.assert_allclose(step(states[run, k - 1], sample), states[run, k], rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(observe(states[run, k], sample), shown[run, k], rtol=1e-12)


def test_the_process_jacobians_are_those_of_the_sampled_simulation(body):
    vehicle, runs = body
    process, drive = VehicleProcess.of(vehicle, runs.substeps), samples(runs)
    theta, x = jnp.full(len(vehicle.layout.free), 0.1), jnp.array([0.2, 0.1, 0.05, 1.0])

    @jax.jit
    def both(sample, index):
        exact = lambda x, theta: Sampled.of(moved(vehicle, theta), runs).step(x, sample.inputs.nodes, index)
        right = exact(x, theta), jax.jacfwd(exact)(x, theta), jax.jacfwd(exact, 1)(x, theta)
        return linearised(lambda x, theta: process.step(x, theta, sample), x, theta), right

    errors = []
    for seconds in (0.3, 0.1):
        k = int(np.argmin(np.abs(drive.elapsed[1, 1:8] - seconds)))
        np.testing.assert_allclose(drive.elapsed[1, k + 1], seconds, rtol=1e-9)
        (value, by_x, by_theta), (right, right_by_x, right_by_theta) = both(at(drive, 1, k + 1), runs.step_of[1, k])
        np.testing.assert_allclose(value, right, rtol=1e-12)
        np.testing.assert_allclose(by_x, right_by_x, rtol=1e-10, atol=1e-13)
        errors.append(np.abs(by_theta - right_by_theta).max() / np.abs(right_by_theta).max())
    # a derivative by the parameters of the scheme's order four: in a third of the step far more than 3² times better
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 3**3


def test_angles_of_a_body_are_wrapped_and_nothing_else_is():
    process = VehicleProcess.of(nps_auv_ii())
    channels = process.vehicle.layout.channels
    innovation = process.innovation(jnp.full(len(channels), 6.3), jnp.zeros(len(channels)))
    expected = [6.3 - 2 * np.pi if name in ("phi", "theta", "psi") else 6.3 for name in channels]
    np.testing.assert_allclose(innovation, expected, rtol=1e-12)


def test_an_actuator_with_a_memory_is_refused():
    with pytest.raises(InputError, match=r"DSRV: .*actuator-lag\[stern_plane\].*output error"):
        VehicleProcess.of(dsrv().with_effect(ActuatorLag("stern_plane", 0.4)))


def test_noise_of_a_state_that_nothing_measures_comes_from_its_rate_or_integral():
    vehicle = coupled()
    assert vehicle.layout.channels == ("a", "b", "b_rate")
    np.testing.assert_array_equal(state_scale(vehicle, jnp.array([0.1, 0.2, 0.3])), [0.1, 0.3, 0.1, 0.2])
    body = nps_auv_ii()
    sigma = jnp.arange(1.0, 11.0)
    order = [*"uvwpqr", "phi", "theta", "psi", "z"]
    assert list(body.layout.channels) == order
    np.testing.assert_array_equal(state_scale(body, sigma), sigma)


@pytest.mark.parametrize("kind", [ModifiedKalmanFilter, ExtendedKalmanFilter])
def test_coefficients_are_recovered_from_30_percent_off(kind):
    vehicle = oscillator()
    runs = recorded(vehicle, 2, 150, 0.2, 3, amplitude=1.0)
    process = VehicleProcess.of(vehicle)
    filter = vehicle_filter(process, jnp.array([0.01, 0.02]), kind)
    signs = jnp.asarray(np.random.default_rng(0).choice([-1.0, 1.0], (6, 3)))
    find = lambda theta: identify(filter, samples(runs), at_rest(vehicle, 2), theta, passes=2)
    found = jax.jit(jax.vmap(find))(0.3 * signs)
    assert not found.diverged.any()
    # zero is the truth, in each coefficient's own size
    assert np.abs(found.theta).max() < 0.03


def test_on_line_steps_of_a_vehicle_are_its_off_line_run_and_compile_once(body):
    vehicle, runs = body
    filter = vehicle_filter(VehicleProcess.of(vehicle, runs.substeps), jnp.full(4, 0.01))
    p, drive, start = len(vehicle.layout.free), samples(runs), jnp.zeros((2, 4))
    state = filter.start(start[0], jnp.full(p, 0.2), 0.5 * jnp.eye(p))
    _, estimates = jax.jit(lambda state: over_runs(filter, state, drive, start))(state)
    step = on_line(filter)
    for run in range(2):
        state = filter.restart(state, start[run])
        for k in range(12):
            state, estimate = step(state, at(drive, run, k))
            np.testing.assert_allclose(estimate.theta, estimates.theta[run, k], rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(estimate.x, estimates.x[run, k], rtol=1e-9, atol=1e-12)
    assert step._cache_size() == 1
    assert np.abs(estimates.theta[-1, -1] - 0.2).max() > 0.01


def test_a_recorded_gap_in_a_channel_is_no_measurement_of_zero():
    vehicle = oscillator()
    whole = synthetic(vehicle, [driven(vehicle, 0.2 * np.arange(30), 1, amplitude=1.0)], seed=1)[0]
    gap = lambda name, c: np.where((np.arange(30) % 3 > 0) & (name == "x"), np.nan, c)
    columns = {name: gap(name, c) for name, c in whole.columns.items()}
    runs = stacked(vehicle, [Recording("gaps", whole.times, columns, "gaps")])
    filter = vehicle_filter(VehicleProcess.of(vehicle), jnp.array([0.01, 0.02]))
    state = filter.start(jnp.zeros(2), jnp.zeros(3), 1e-3 * jnp.eye(3))
    _, estimates = over_runs(filter, state, samples(runs), jnp.zeros((1, 2)))
    pairs = zip(estimates.factor[0], estimates.innovation[0], strict=True)
    whitened = np.stack([np.linalg.solve(L, e) for L, e in pairs])
    assert np.abs(whitened).max() < 4.0
    assert (np.asarray(estimates.innovation)[~np.asarray(runs.mask)] == 0.0).all()
