"""A motion with standard deviations, as states of `AidedNavigation` and their covariance say it."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..arrays import Values
from ..filter import Sample, Smoothed
from .aided import scaled_rate
from .rotation import euler, matrix

MOTION = ("phi", "theta", "psi", "u", "v", "w", "x", "y", "z")


class Track(eqx.Module):
    """A motion at K rows, of the origin of the body's axes.

    **Fields**

    - `motion`: (K, 9) of `MOTION`: rad, m/s in body axes, m NED; `motion_std`: its standard deviations.
    - `q`: (K, 4) attitude. `turn_std`: (K, 3) rad, of its error about north, east and down.
    - `constants`: (K, 15 + delays) biases of gyros (rad/s) and accelerometers (m/s²), the gyros' scale errors and
      misalignments (rad), delays (s); `constants_std`: their standard deviations.
    """

    motion: Float[Values, "*k 9"]
    motion_std: Float[Values, "*k 9"]
    q: Float[Values, "*k 4"]
    turn_std: Float[Values, "*k 3"]
    constants: Float[Values, "*k m"]
    constants_std: Float[Values, "*k m"]


class Shown(eqx.Module):
    r"""What a state says of the motion of the body's origin, from which the accelerometer sits at `arm`.

    With δ the attitude's error in the navigation frame, $R^Tv$ changes by $R^T(\delta v - \delta\times v)$ and the
    Euler angles by $\dot\psi$ and so on of a rate δ, in axes NED.
    """

    arm: Float[Array, "3"]

    def __call__(self, known: Smoothed, sample: Sample) -> Track:
        """One row of a track."""
        x, P = known.x, known.covariance
        R, v = matrix(x[:4]), x[4:7]
        angles = euler(x[:4])
        rate = scaled_rate(x, sample.inputs.inertial.gyro) - x[10:13]
        velocity, position = R.T @ v - jnp.cross(rate, self.arm), x[7:10] - R @ self.arm
        none = jnp.zeros((3, 3), x.dtype)
        by_turn = jnp.concatenate([_angles_by_turn(angles), R.T @ _cross(v), _cross(R @ self.arm)])
        by_velocity = jnp.concatenate([none, R.T, none])
        by_position = jnp.concatenate([none, none, jnp.eye(3, dtype=x.dtype)])
        by_bias = jnp.concatenate([none, -_cross(self.arm), none])
        J = jnp.concatenate([by_turn, by_velocity, by_position, by_bias], axis=1)
        motion_std = _root(jnp.sum((J @ P[:12, :12]) * J, axis=1))
        std = _root(jnp.diag(P))
        motion = jnp.concatenate([angles, velocity, position])
        return Track(motion, motion_std, x[:4], std[:3], x[10:], std[9:])


def _root(variance: Float[Array, " k"]) -> Float[Array, " k"]:
    return jnp.sqrt(jnp.maximum(variance, 0.0))


def _cross(v: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """The matrix of v ×."""
    x, y, z = v
    zero = jnp.zeros_like(x)
    return jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])


def _angles_by_turn(angles: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Change of φ, θ, ψ by a small rotation about north, east and down; at 90° of pitch it is unbounded, here large."""
    _, pitch, yaw = angles
    c, s, cosine = jnp.cos(yaw), jnp.sin(yaw), jnp.maximum(jnp.cos(pitch), 1e-3)
    zero, one = jnp.zeros_like(c), jnp.ones_like(c)
    return jnp.stack(
        [
            jnp.stack([c / cosine, s / cosine, zero]),
            jnp.stack([-s, c, zero]),
            jnp.stack([c * jnp.tan(pitch), s * jnp.tan(pitch), one]),
        ]
    )
