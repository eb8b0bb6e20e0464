r"""The second paper's position filter as a process (its eqs. 11 to 16).

State: north, east, down, m. It goes where the body's x axis points, at the speed that a log or a pitot tube measures.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..filter import AbstractProcess, Sample
from .rotation import exponential, matrix, normalised, product


class Course(eqx.Module):
    """What drives a position in the interval before a sample.

    **Fields**

    - `speed`: m/s along the body's x axis. `attitude`: (4,) quaternion of the body, of unit length.
    - `attitude_std`: (3,) rad, standard deviations of its rotation about the body's axes.
    """

    speed: Float[Array, " *k"]
    attitude: Float[Array, "*k 4"]
    attitude_std: Float[Array, "*k 3"]


class DeadReckoning(AbstractProcess):
    r"""$p \leftarrow p + T\,R(q)[V_P, 0, 0]^T$ and $P \leftarrow P + T\,(Q + GQ_uG^T)$; the position is measured.

    G is the derivative by the inputs, speed and attitude, and $Q_u$ their variance, which stays the same for about
    `correlation` seconds: a density $2\tau\sigma^2$.

    **Fields**

    - `speed_std`: m/s. `correlation`: τ, s.
    """

    speed_std: float = 0.5
    correlation: float = 1.0

    def step(self, x: Float[Array, "3"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "3"]:
        """Equation 12."""
        return x + sample.elapsed * _velocity(sample.inputs, jnp.zeros(4, x.dtype))

    def driven(
        self, x: Float[Array, "3"], theta: Float[Array, " p"], sample: Sample, root: Float[Array, "3 m"]
    ) -> Float[Array, "3 k"]:
        """Equation 13: the rule's noise and G Q_u Gᵀ."""
        G = jax.jacfwd(lambda change: _velocity(sample.inputs, change))(jnp.zeros(4, x.dtype))
        std = jnp.concatenate([jnp.full(1, self.speed_std, x.dtype), sample.inputs.attitude_std])
        return jnp.concatenate([root, G * std * jnp.sqrt(2.0 * self.correlation * sample.elapsed)], axis=1)

    def observe(self, x: Float[Array, "3"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "3"]:
        """The position."""
        return x


def _velocity(course: Course, change: Float[Array, "4"]) -> Float[Array, "3"]:
    """The velocity, m/s, with speed and attitude changed."""
    q = normalised(product(course.attitude, exponential(change[1:])))
    return matrix(q)[:, 0] * (course.speed + change[0])
