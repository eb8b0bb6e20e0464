"""Strapdown navigation goes where closed forms say, and a filter of it stays finite where nothing is known."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsub.filter import ConstantNoise, ExtendedKalmanFilter, FuzzyNoise, Sample, on_line
from jaxsub.navigation.alignment import MagneticField
from jaxsub.navigation.strapdown import Inertial, SensorNoise, StrapdownNavigation

G = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([18.0, 0.0, 44.0])
PROCESS = StrapdownNavigation(SensorNoise(magnetic_delay=0.01), MagneticField(FIELD[0], FIELD[2], 1.5))
NOTHING = jnp.zeros(0)
R_STD = np.array([0.5, 0.5, 1.0, 0.1, 0.1, 0.1, 3.0])
FIRST = np.repeat([0.05, 0.1, 0.5, 0.01, 0.1], 3)
rng = np.random.default_rng(17)


def sample(gyro, force, field=(0.0, 0.0, 0.0), elapsed=0.01, outputs=None, mask=None):
    inertial = Inertial(*(jnp.asarray(part, float) for part in (gyro, force, field)))
    mask = np.zeros(7, bool) if mask is None else mask
    return Sample(inertial, jnp.asarray(elapsed), jnp.zeros(7) if outputs is None else outputs, jnp.asarray(mask))


def state_at(attitude=None, velocity=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), biases=np.zeros(6)):
    q = (attitude or Rotation.identity()).as_quat(scalar_first=True)
    return jnp.concatenate([jnp.asarray(part, float) for part in (q, velocity, position, biases)])


def attitude_of(x):
    return Rotation.from_quat(np.asarray(x[:4]), scalar_first=True)


def a_filter(noise=None, process=PROCESS):
    noise = noise or ConstantNoise(jnp.diag(jnp.repeat(jnp.array([0.0, 0.0, 0.0, 1e-5, 1e-4]), 3)))
    return ExtendedKalmanFilter(process, noise, jnp.diag(jnp.asarray(R_STD)), jnp.diag(jnp.asarray(FIRST)))


def stacked(samples):
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *samples)


@eqx.filter_jit
def scanned(filter, x, samples):
    start = filter.start(x, NOTHING, jnp.zeros((0, 0)))
    return jax.lax.scan(lambda state, z: filter.step(state, z), start, samples)


def test_a_constant_rate_and_force_converge_to_the_exact_path_with_the_square_of_the_step():
    rate, force, biases = np.array([0.4, -0.7, 1.1]), np.array([1.0, 2.0, -9.0]), np.array([0.1, 0, 0, 0, 0.2, 0])
    attitude, velocity = Rotation.from_euler("ZYX", [0.5, 0.2, -0.3]), np.array([3.0, 1.0, -1.0])

    def slope(t, y):
        turned = attitude * Rotation.from_rotvec((rate - biases[:3]) * t)
        return np.concatenate([y[3:], turned.apply(force - biases[3:]) + G])

    exact = solve_ivp(slope, (0.0, 2.0), np.concatenate([np.zeros(3), velocity]), rtol=1e-11, atol=1e-11).y[:, -1]
    errors = []
    for steps in (20, 40, 80):
        inputs = sample(rate, force, elapsed=2.0 / steps)
        step = jax.jit(lambda x, inputs=inputs: PROCESS.step(x, NOTHING, inputs))
        x = state_at(attitude, velocity, biases=biases)
        for _ in range(steps):
            x = step(x)
        errors.append(np.linalg.norm(np.concatenate([x[7:10], x[4:7]]) - exact))
        turned = attitude * Rotation.from_rotvec((rate - biases[:3]) * 2.0)
        assert (attitude_of(x).inv() * turned).magnitude() < 1e-12
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.1)


def test_moved_and_apart_are_inverses():
    x, change = state_at(Rotation.random(rng=rng)), jnp.asarray(rng.normal(size=15))
    np.testing.assert_allclose(PROCESS.difference(PROCESS.moved(x, change), x), change, atol=1e-12)


def test_the_jacobians_are_those_of_differences():
    x = state_at(Rotation.random(rng=rng), rng.normal(size=3), rng.normal(size=3), 0.1 * rng.normal(size=6))
    inputs = sample(rng.normal(size=3), rng.normal(size=3) - G, 0.1 * rng.normal(size=3) + FIELD)
    after = PROCESS.step(x, NOTHING, inputs)
    step = jax.jit(lambda c: PROCESS.difference(PROCESS.step(PROCESS.moved(x, c), NOTHING, inputs), after))
    see = jax.jit(lambda c: PROCESS.observe(PROCESS.moved(x, c), NOTHING, inputs)[:6])
    for f in (step, see):
        J = jax.jacfwd(f)(jnp.zeros(15))
        rows = [(f(d) - f(-d)) / 2e-6 for d in 1e-6 * np.eye(15)]
        np.testing.assert_allclose(J, np.stack(rows, axis=1), atol=1e-8)


def test_the_driving_noise_of_a_step_is_that_of_noisy_readings():
    attitude, elapsed = Rotation.random(rng=rng), 0.02
    noise = SensorNoise(gyro=0.01, accelerometer=0.1, gyro_share=0.02, accelerometer_share=0.03)
    gyro, force = np.array([1.0, -2.0, 0.5]), np.array([1.0, -2.0, -9.0])
    inputs = sample(gyro, force, elapsed=elapsed)
    root = StrapdownNavigation(noise).driven(state_at(attitude), NOTHING, inputs, jnp.eye(15))
    own = np.asarray(root[:, 15:] @ root[:, 15:].T)
    R = attitude.as_matrix()
    for block, density, share, read in ((slice(0, 3), 0.01, 0.02, gyro), (slice(3, 6), 0.1, 0.03, force)):
        expected = R @ np.diag((density**2 + (share * read) ** 2) * elapsed) @ R.T
        np.testing.assert_allclose(own[block, block], expected, atol=1e-15)
    np.testing.assert_array_equal(root[:, :15], np.eye(15))


@pytest.mark.parametrize("seen", [FIELD, FIELD + np.array([5.0, 6.0, 30.0])], ids=["undisturbed", "disturbed"])
def test_a_magnetic_heading_corrects_yaw_alone(seen):
    true = Rotation.from_euler("ZYX", [0.3, -0.4, 0.5])
    held = Rotation.from_rotvec([0.0, 0.0, 0.2]) * true
    back = true.inv()
    still = sample(np.zeros(3), back.apply(-G), back.apply(seen), 0.0, mask=np.arange(7) == 6)
    state, estimate = scanned(a_filter(), state_at(held), stacked([still]))
    # a scalar's gain, with the noise that the two components that do not turn the heading tell
    apart = (np.hypot(*seen[:2]) - FIELD[0]) ** 2 + (seen[2] - FIELD[2]) ** 2
    noise = R_STD[6] * np.sqrt(1.5**2 + apart / 2.0) / np.hypot(*seen[:2])
    gain = FIRST[2] ** 2 / (FIRST[2] ** 2 + noise**2)
    turned = (attitude_of(state.x) * held.inv()).as_rotvec()
    np.testing.assert_allclose(turned, [0.0, 0.0, -gain * (0.2 + np.arctan2(seen[1], seen[0]))], rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(estimate.x_std[0, :3], [*FIRST[:2], FIRST[2] * np.sqrt(1.0 - gain)], rtol=1e-4)


def test_the_magnetometers_delay_is_taken_off():
    rate, true = np.array([0.3, -0.2, 4.0]), Rotation.from_euler("ZYX", [0.3, -0.4, 0.5])
    earlier = true * Rotation.from_rotvec(-0.01 * rate)
    seen = PROCESS.observe(state_at(true), NOTHING, sample(rate, -G, earlier.inv().apply(FIELD)))
    np.testing.assert_allclose(seen[6], 0.0, atol=1e-12)
    late = StrapdownNavigation(SensorNoise(), PROCESS.field)
    assert abs(late.observe(state_at(true), NOTHING, sample(rate, -G, earlier.inv().apply(FIELD)))[6]) > 0.3


def test_a_gyro_at_its_stop_widens_the_attitude_by_its_range():
    sensors = SensorNoise(gyro_range=10.0)
    calm, stopped = (sample([0.0, 0.0, rate], -G, elapsed=0.01) for rate in (9.9, 10.0))
    filter = a_filter(process=StrapdownNavigation(sensors))
    widths = [scanned(filter, state_at(), stacked([inputs]))[1].x_std[0, :3] for inputs in (calm, stopped)]
    np.testing.assert_allclose(widths[1][2] ** 2 - FIRST[2] ** 2, 0.1**2 + (0.01 * FIRST[11]) ** 2, rtol=1e-3)
    assert widths[0][2] < 1.02 * FIRST[2]
    np.testing.assert_allclose(widths[0][:2], widths[1][:2], rtol=1e-2)


def hovering(count, mask):
    """A unit that hangs at 20° of pitch with a gyro bias and noise, and fixes where `mask` has them."""
    true = Rotation.from_euler("ZYX", [0.3, 0.35, 0.0])
    bias = np.array([0.005, -0.004, 0.003])
    gyro = bias + 1e-3 * rng.normal(size=(count, 3))
    force = true.inv().apply(-G) + 0.05 * rng.normal(size=(count, 3))
    field = np.tile(true.inv().apply(FIELD), (count, 1))
    elapsed = jnp.full(count, 0.05).at[0].set(0.0)
    inputs = Inertial(*map(jnp.asarray, (gyro, force, field)))
    return true, bias, Sample(inputs, elapsed, jnp.zeros((count, 7)), jnp.asarray(mask))


@pytest.mark.parametrize("rule", [pytest.param("constant", marks=pytest.mark.long), "fuzzy"])
def test_on_line_it_is_the_same_as_off_line_and_finds_attitude_and_bias(rule):
    least = jnp.repeat(jnp.array([0.0, 0.0, 0.0, 1e-5, 1e-4]), 3)
    noise = FuzzyNoise(least, 100.0 * least, width=5) if rule == "fuzzy" else None
    mask = np.tile(np.array([True] * 3 + [False] * 3 + [True]), (600, 1)) & (np.arange(600) % 5 == 0)[:, None]
    true, bias, samples = hovering(600, mask)
    filter = a_filter(noise)
    x = state_at(Rotation.from_rotvec([0.05, -0.05, 0.1]) * true)
    state, estimates = scanned(filter, x, samples)
    errors = np.concatenate([(true * attitude_of(state.x).inv()).as_rotvec(), bias - state.x[10:13]])
    widths = np.concatenate([estimates.x_std[-1, :3], estimates.x_std[-1, 9:12]])
    assert np.all(np.abs(errors) < 3.0 * widths)
    assert np.all(widths[:2] < 0.5 * FIRST[:2]) and np.all(widths[3:5] < 0.5 * FIRST[9:11])
    step, streamed = on_line(filter), filter.start(x, NOTHING, jnp.zeros((0, 0)))
    for k in range(60):
        streamed, estimate = step(streamed, jax.tree.map(lambda leaf, k=k: leaf[k], samples))
    np.testing.assert_allclose(estimate.x, estimates.x[59], atol=1e-12)
    np.testing.assert_allclose(estimate.x_std, estimates.x_std[59], atol=1e-12)


@pytest.mark.parametrize(
    "case",
    [
        "no quaternion",
        "free fall",
        "nose up",
        "no field",
        pytest.param("minutes without a fix", marks=pytest.mark.long),
    ],
)
def test_nothing_ceases_to_be_finite(case):
    count = 2400 if case == "minutes without a fix" else 20
    mask = np.tile(np.array([True] * 3 + [False] * 3 + [True]), (count, 1))
    mask[1:] &= case != "minutes without a fix"
    true, _, samples = hovering(count, mask)
    x = state_at(Rotation.from_euler("ZYX", [0.0, np.pi / 2, 0.0]) if case == "nose up" else true)
    inputs = samples.inputs
    if case == "no quaternion":
        x = x.at[:4].set(0.0)
    if case == "free fall":
        inputs = dataclasses.replace(inputs, accelerometer=jnp.zeros_like(inputs.accelerometer))
    if case == "no field":
        inputs = dataclasses.replace(inputs, magnetometer=jnp.zeros_like(inputs.magnetometer))
    state, estimates = scanned(a_filter(), x, dataclasses.replace(samples, inputs=inputs))
    assert not state.diverged
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(estimates))
    assert np.linalg.norm(state.x[:4]) == pytest.approx(1.0)
    if case == "minutes without a fix":
        assert np.all(np.diff(estimates.x_std[:, 6]) >= 0.0) and estimates.x_std[-1, 6] > 100.0
