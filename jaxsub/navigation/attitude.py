r"""The second paper's attitude filter as a process (its eqs. 3 to 10 and 17).

State $[q, b]$: the body's quaternion and the gyros' bias, rad/s. Channels: roll, pitch and yaw, rad, such as
`constructed` makes of GPS and accelerometers.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..filter import AbstractProcess, Sample
from .rotation import conjugate, euler, exponential, logarithm, omega_matrix, product, squared_length, wrapped


class Gyro(eqx.Module):
    """What drives an attitude in the interval before a sample.

    **Fields**

    - `rate`: (3,) rad/s, body axes.
    """

    rate: Float[Array, "*k 3"]


class AbstractAttitude(AbstractProcess):
    """An attitude that gyros drive and whose Euler angles are measured.

    A quaternion of no length stands for the identity, as uncertain as any other.

    **Fields**

    - `gyro_range`: rad/s. A saturated gyro shows no more than that the body turns faster: what it shows is then its
      standard deviation besides.
    """

    gyro_range: eqx.AbstractVar[float]

    def observe(self, x: Float[Array, "7"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "3"]:
        """Euler(q)."""
        return euler(x[:4])

    def innovation(self, measured: Float[Array, "3"], expected: Float[Array, "3"]) -> Float[Array, "3"]:
        """The difference, wrapped."""
        return wrapped(measured - expected)

    def unknown_turn(self, sample: Sample) -> Float[Array, "3"]:
        """(3,) rad about the body's axes that gyros at their stops may have missed."""
        rate = sample.inputs.rate
        return jnp.where(jnp.abs(rate) >= self.gyro_range, rate, 0.0) * sample.elapsed


class PaperAttitude(AbstractAttitude):
    r"""Equations 3 to 5 and 8 to 9 as written, with the ½ that eq. 3 leaves out: seven numbers, seven ways to change.

    $q \leftarrow (I + \tfrac T2\Omega(\omega - b))\,q$, then made of unit length; a correction is added to the
    quaternion, which is then made of unit length again. Along q its covariance holds what the rule's noise puts there:
    without any it is singular.
    """

    gyro_range: float = math.inf

    def moved(self, x: Float[Array, "7"], change: Float[Array, "7"]) -> Float[Array, "7"]:
        """Equations 8 and 9."""
        return jnp.concatenate([_unit(_unit(x[:4]) + change[:4]), x[4:] + change[4:]])

    def step(self, x: Float[Array, "7"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "7"]:
        """Equations 3 to 5."""
        q, bias = _unit(x[:4]), x[4:]
        q = q + 0.5 * sample.elapsed * (omega_matrix(sample.inputs.rate - bias) @ q)
        return jnp.concatenate([_unit(q), bias])

    def driven(
        self, x: Float[Array, "7"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "7 m"]
    ) -> Float[Array, "7 k"]:
        """The rule's noise, and the turns that saturated gyros miss."""
        ways = 0.5 * jax.vmap(omega_matrix)(jnp.eye(3, dtype=x.dtype)) @ _unit(x[:4])
        return jnp.concatenate([root, jnp.pad(ways.T * self.unknown_turn(sample), ((0, 3), (0, 0)))], axis=1)


class RotationAttitude(AbstractAttitude):
    r"""The same, its change a rotation: $[\delta, b]$ with $q = \hat q\otimes\exp(\delta)$ in body axes, six ways.

    No direction is without meaning, so that six numbers say what is not known, and a constant rate is followed exactly.
    """

    gyro_range: float = math.inf

    def moved(self, x: Float[Array, "7"], change: Float[Array, "6"]) -> Float[Array, "7"]:
        """The attitude turned by δ about its own axes, the bias added."""
        turned = product(_unit(x[:4]), exponential(change[:3]))
        return jnp.concatenate([_unit(turned), x[4:] + change[3:]])

    def difference(self, x: Float[Array, "7"], origin: Float[Array, "7"]) -> Float[Array, "6"]:
        """The rotation between the two, and the difference of the biases."""
        return jnp.concatenate([logarithm(product(conjugate(origin[:4]), x[:4])), x[4:] - origin[4:]])

    def step(self, x: Float[Array, "7"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "7"]:
        """The rate taken as constant over the interval."""
        turn = exponential((sample.inputs.rate - x[4:]) * sample.elapsed)
        return jnp.concatenate([_unit(product(_unit(x[:4]), turn)), x[4:]])

    def driven(
        self, x: Float[Array, "7"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "6 m"]
    ) -> Float[Array, "6 k"]:
        """The rule's noise, and the turns that saturated gyros miss."""
        missed = jnp.pad(jnp.diag(self.unknown_turn(sample)), ((0, 3), (0, 0)))
        return jnp.concatenate([root, missed], axis=1)


def _unit(q: Float[Array, "4"]) -> Float[Array, "4"]:
    """q of unit length, the identity for one of none; what is not finite stays so, that the filter may say it."""
    squared = squared_length(q)
    none = squared == 0.0
    return jnp.where(none, jnp.array([1.0, 0.0, 0.0, 0.0], q.dtype), q) / jnp.sqrt(jnp.where(none, 1.0, squared))
