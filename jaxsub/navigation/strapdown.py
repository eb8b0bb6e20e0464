r"""Strapdown inertial navigation as a process that filters follow.

The gyros and accelerometers are what drives it, and everything else is measured: a GPS fix, a velocity, a magnetic
heading. Source: Titterton and Weston (2004), §3 and §12; the attitude's error is a rotation δ in the navigation frame,
$q = \exp(\delta)\otimes\hat q$.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float

from ..effects import GRAVITY
from ..filter import AbstractProcess, Sample
from .alignment import MagneticField
from .rotation import angle, conjugate, exponential, logarithm, matrix, normalised, product

_Number = Float[Array, ""] | float


class Inertial(eqx.Module):
    """What a strapdown unit reads in the interval before a sample, body axes.

    **Fields**

    - `gyro`: (3,) rad/s. `accelerometer`: (3,) specific force, m/s².
    - `magnetometer`: (3,) in the unit of the process's field; used only where a magnetic heading is measured.
    """

    gyro: Float[Array, "*k 3"]
    accelerometer: Float[Array, "*k 3"]
    magnetometer: Float[Array, "*k 3"]


class SensorNoise(eqx.Module):
    r"""What a strapdown unit's readings leave unknown.

    A scale error ε is no white noise, but the turns that it falsifies go to and fro: over times longer than the
    motion's correlation time τ it drives the attitude like white noise of density $\varepsilon\sqrt{2\tau}|\omega|$.

    **Fields**

    - `gyro`: rad/s/√Hz; `accelerometer`: m/s²/√Hz: white noise.
    - `gyro_share`, `accelerometer_share`: √s, $\varepsilon\sqrt{2\tau}$ of each axis.
    - `gyro_range`: rad/s. A saturated gyro shows no more than that the body turns faster.
    - `magnetic_delay`: s by which the magnetometer's readings are older than the gyros'.
    """

    gyro: _Number = math.radians(0.01)
    accelerometer: _Number = 0.01
    gyro_share: _Number = 0.005
    accelerometer_share: _Number = 0.005
    gyro_range: _Number = math.radians(2000.0)
    magnetic_delay: _Number = 0.0


class StrapdownNavigation(AbstractProcess):
    r"""State $[q, v, p, b_g, b_a]$, 16 numbers with 15 ways to change, $[\delta, v, p, b_g, b_a]$; flat, still Earth.

    $\dot q = \tfrac12 q\otimes(\omega - b_g)$, $\dot v = R(q)(f - b_a) + g$, $\dot p = v$, biases constant but for the
    rule's noise. Channels: position (3), m; velocity (3), m/s; and the heading of the magnetic field in terms of its
    standard deviation, of which zero is measured.

    **Fields**

    - `sensors`: their noise. `field`: Earth's, by default that of middle latitudes in µT.
    """

    sensors: SensorNoise = SensorNoise()
    field: MagneticField = MagneticField(20.0, 44.0, 1.5)

    def moved(self, x: Float[Array, "16"], change: Float[Array, "15"]) -> Float[Array, "16"]:
        """The attitude turned by δ about the navigation axes, the rest added."""
        turned = normalised(product(exponential(change[:3]), x[:4]))
        return jnp.concatenate([turned, x[4:] + change[3:]])

    def difference(self, x: Float[Array, "16"], origin: Float[Array, "16"]) -> Float[Array, "15"]:
        """The rotation between the two, and the differences of the rest."""
        return jnp.concatenate([logarithm(product(x[:4], conjugate(origin[:4]))), x[4:] - origin[4:]])

    def gravity(self, dtype: DTypeLike) -> Float[Array, "3"]:
        """Gravity (3,) north, east, down, m/s², of type `dtype`."""
        return jnp.array([0.0, 0.0, GRAVITY], dtype)

    def step(self, x: Float[Array, "16"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "16"]:
        """Readings taken as constant over the interval; the velocity turned at its middle."""
        q, v, p, gyro_bias, bias = x[:4], x[4:7], x[7:10], x[10:13], x[13:]
        T = sample.elapsed
        turn = (sample.inputs.gyro - gyro_bias) * T
        half = product(q, exponential(turn / 2.0))
        acceleration = matrix(half) @ (sample.inputs.accelerometer - bias) + self.gravity(x.dtype)
        q = normalised(product(q, exponential(turn)))
        return jnp.concatenate([q, v + T * acceleration, p + T * (v + T * acceleration / 2.0), x[10:]])

    def driven(
        self, x: Float[Array, "16"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "15 m"]
    ) -> Float[Array, "15 k"]:
        """The rule's noise, and that of the sensors; a gyro at its stop leaves a turn of its range unknown."""
        noise, T, read = self.sensors, sample.elapsed, sample.inputs
        stuck = jnp.abs(read.gyro) >= noise.gyro_range
        density = jnp.sqrt(noise.gyro**2 + (noise.gyro_share * (read.gyro - x[10:13])) ** 2)
        turned = jnp.where(stuck, noise.gyro_range * T, density * jnp.sqrt(T))
        density = jnp.sqrt(noise.accelerometer**2 + (noise.accelerometer_share * read.accelerometer) ** 2)
        R = matrix(normalised(x[:4]))
        own = jnp.zeros((15, 6), x.dtype).at[:3, :3].set(R * turned).at[3:6, 3:].set(R * density * jnp.sqrt(T))
        return jnp.concatenate([root, own], axis=1)

    def observe(self, x: Float[Array, "16"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "7"]:
        """Position, velocity, and minus the heading of the magnetic field as the attitude had it when it was read.

        Only the turn about the vertical answers for the field's heading: its inclination differs from place to place,
        so that a disturbed field may spoil the heading but not roll and pitch.
        """
        since = (sample.inputs.gyro - x[10:13]) * self.sensors.magnetic_delay
        R = matrix(product(x[:4], exponential(-since)))
        heading = field_heading(R, sample.inputs.magnetometer, self.field)
        return jnp.concatenate([x[7:10], x[4:7], -heading[None]])


def field_heading(R: Float[Array, "3 3"], magnetometer: Float[Array, "3"], field: MagneticField) -> Float[Array, ""]:
    """The heading of a field that was read in body axes of attitude R, in terms of its standard deviation.

    It changes with the attitude's turn about the vertical alone.
    """
    held = jax.lax.stop_gradient(R)
    seen = held @ magnetometer
    north, east, _ = R @ (held.T @ (seen * jnp.array([1.0, 1.0, 0.0], seen.dtype)))
    return angle(north, east) / field.heading_std(seen)
