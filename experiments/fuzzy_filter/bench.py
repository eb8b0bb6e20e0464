"""The paper's bench in simulation: a board that is tilted once, with its section 5's sensors.

The paper names its sensors (ADXRS150, ADXL105, GPS at 1 Hz) but not the motion. A percentage error that starts at
-100 % and comes up, as in its Figs 6 to 8, is that of a filter which stands level when the board does not; so the board
is turned between two gyro samples and the filter has to find the new angle from its measurements. `seen` shows the
gyros the turn instead. The board travels north at 20 m/s, without which GPS has no track.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Key

from jaxsub.effects import GRAVITY
from jaxsub.filter import AbstractNoiseRule, AbstractProcess, Estimate, ExtendedKalmanFilter, Sample
from jaxsub.navigation.attitude import Gyro
from jaxsub.navigation.constructed import ConstructedAttitude, constructed_over, standard_deviations
from jaxsub.navigation.rotation import euler, from_euler, matrix

DEGREE = math.pi / 180.0
INTERVAL, PER_FIX = 0.25, 4  # three time updates, then one with a measurement, at 1 Hz
SAMPLES, TURN = 480, 120
SPEED = 20.0
# m, what differs between fixes a second apart; m/s², noise and null of an accelerometer after calibration
FIX, ACCELEROMETER, NULL = 0.1, 0.02, 0.02
# of a gyro sample with 40 Hz bandwidth, of its null, and of the wander of that, degrees and seconds
RATE, BIAS, WANDER = 0.4 * DEGREE, 0.5 * DEGREE, 0.01 * DEGREE
# what is known of the process: the angle's random walk, and twice the wander of the nulls, for a density that is too
# small hurts more than one that is too large
ATTITUDE_DENSITY, BIAS_DENSITY = RATE * math.sqrt(INTERVAL), 2.0 * WANDER


class Bench(NamedTuple):
    """One run, (K,) samples; angles in rad."""

    times: Float[Array, " k"]
    angles: Float[Array, "k 3"]
    gyro: Float[Array, "k 3"]
    bias: Float[Array, "k 3"]
    measured: ConstructedAttitude
    scale: Float[Array, "k 3"]


def bench(angle: Float[Array, ""], key: Key[Array, ""], seen: bool = False) -> Bench:
    """The board pitched by `angle`, rad, at sample `TURN`."""
    draw = iter(jax.random.split(key, 6))
    normal = lambda *shape: jax.random.normal(next(draw), shape)
    times = jnp.arange(SAMPLES) * INTERVAL
    pitch = jnp.where(jnp.arange(SAMPLES) < TURN, 0.0, angle)
    angles = jnp.stack([0.0 * pitch, pitch, 0.0 * pitch], axis=1)
    bias = BIAS * normal(3) + WANDER * math.sqrt(INTERVAL) * jnp.cumsum(normal(SAMPLES, 3), axis=0)
    turning = jnp.zeros((SAMPLES, 3)).at[TURN, 1].set(angle / INTERVAL if seen else 0.0)
    gyro = turning + bias + RATE * normal(SAMPLES, 3)
    gravity = jnp.array([0.0, 0.0, -GRAVITY])
    force = jax.vmap(lambda a: matrix(from_euler(a)).T @ gravity)(angles)
    force = force + NULL * normal(3) + ACCELEROMETER * normal(SAMPLES, 3)
    fixes = jnp.stack([SPEED * times, 0.0 * times, 0.0 * times], axis=1) + FIX * normal(SAMPLES, 3)
    measured = constructed_over(times, force, fixes, jnp.arange(SAMPLES) % PER_FIX == 0)
    stds = jnp.full(3, FIX), jnp.full(3, NULL)
    of = lambda window: standard_deviations(window.fixes, window.times, window.accelerometer, *stds)
    scale = jax.vmap(of)(measured.window)
    return Bench(times, angles, gyro, bias, measured, scale)


def filtered(process: AbstractProcess, rule: AbstractNoiseRule, run: Bench) -> Estimate:
    """What the attitude filter makes of `run`, started level with no bias; sensors' noise as `run` says it is."""
    ways = jax.eval_shape(lambda x: process.difference(x, x), jnp.zeros(7)).size
    half = 1.0 if ways == 6 else 0.5  # a quaternion's numbers move by half of an angle
    first = jnp.concatenate([jnp.full(ways - 3, 2.0 * DEGREE * half), jnp.full(3, 1.0 * DEGREE)])
    whole = ExtendedKalmanFilter(process, rule, jnp.eye(3), jnp.diag(first))
    elapsed = jnp.full(SAMPLES, INTERVAL).at[0].set(0.0)
    samples = Sample(Gyro(run.gyro), elapsed, run.measured.angles, run.measured.known, run.scale)
    start = whole.start(jnp.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), jnp.zeros(0), jnp.zeros((0, 0)))
    return jax.lax.scan(lambda state, sample: whole.step(state, sample), start, samples)[1]


def pitch_of(estimate: Estimate) -> Float[Array, " k"]:
    """The pitch, rad."""
    return jax.vmap(lambda x: euler(x[:4])[1])(estimate.x)
