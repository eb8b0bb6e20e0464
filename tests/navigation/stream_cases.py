"""Readings and streams that tests of streams start from."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.filter import ExtendedKalmanFilter, FuzzyNoise, InnovationGate
from jaxsub.navigation.attitude import Gyro, RotationAttitude
from jaxsub.navigation.stream import Reading, Stream

G = 9.80665
STOP = 3.0
BIAS = np.array([0.02, -0.03, 0.01])


def at(readings, index):
    return jax.tree.map(lambda leaf: leaf[index], readings)


def gentle_readings(count=40, seed=0, dtype=jnp.float64):
    """Four a second, roll, pitch and yaw measured with each fourth."""
    rng = np.random.default_rng(seed)
    rate, angles = 0.1 * rng.normal(size=(count, 3)), 0.02 * rng.normal(size=(count, 3))
    mask = np.broadcast_to((np.arange(count) % 4 == 3)[:, None], (count, 3))
    scale = rng.uniform(0.5, 2.0, (count, 3))
    array = lambda values: jnp.asarray(values, dtype)
    return Reading(
        array(3.0 + 0.25 * np.arange(count)), Gyro(array(rate)), array(angles), jnp.asarray(mask), array(scale)
    )


def attitude_stream(noise=None, dtype=jnp.float64):
    noise = noise or FuzzyNoise(jnp.full(6, 1e-3, dtype), jnp.full(6, 0.1, dtype), width=4)
    gate = InnovationGate(jnp.full(3, 5.0, dtype), 3)
    process, R_root = RotationAttitude(STOP), jnp.diag(jnp.full(3, 0.03, dtype))
    x_root = 0.3 * jnp.eye(6, dtype=dtype)
    return Stream(ExtendedKalmanFilter(process, noise, R_root, x_root, gate=gate), Gyro(jnp.full(3, STOP, dtype)))


def started(stream, readings, x=(1.0, 0, 0, 0, 0, 0, 0)):
    kind = readings.time.dtype
    state = stream.filter.start(jnp.asarray(x, kind), jnp.zeros(0, kind), jnp.zeros((0, 0), kind))
    return stream.start(state, at(readings, 0))


def same(found, expected, rtol=0.0, atol=0.0):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=rtol, atol=atol), found, expected)


def counted(faults):
    """What was counted, channels summed, without the zeros."""
    sums = {field.name: int(np.sum(getattr(faults, field.name))) for field in dataclasses.fields(faults)}
    return {name: count for name, count in sums.items() if count}


def spliced(readings, index, **changes):
    """With a copy of reading `index`, changed, after it."""
    extra = dataclasses.replace(at(readings, index), **changes)
    return jax.tree.map(lambda leaf, new: jnp.insert(leaf, index + 1, new, axis=0), readings, extra)


def altered(readings, index, **changes):
    new = dataclasses.replace(at(readings, index), **changes)
    return jax.tree.map(lambda leaf, value: leaf.at[index].set(value), readings, new)
