"""A vehicle of which only the kinematics are known: dead reckoning without a model of its forces."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..vehicle import AbstractVehicle
from ..vehicle.base import stack
from .model import AbstractProcess, Sample


class KinematicProcess(AbstractProcess):
    """Velocities stay as they are, but for noise; positions and angles follow from them, by a step of Runge and Kutta.

    **Fields**

    - `vehicle`: whose states, kinematics and sensors are taken, and none of its forces.
    """

    vehicle: AbstractVehicle

    def step(self, x: Float[Array, " s"], theta: Float[Array, "0"], sample: Sample) -> Float[Array, " s"]:
        """The state at `sample`; there are no parameters."""
        n, start, middle, end = len(self.vehicle.layout.equations), *sample.inputs.nodes

        def rates(position: Array, node: Array) -> Array:
            motion = self.vehicle.motion(jnp.concatenate([x[:n], position]), node)
            return stack(self.vehicle.position_rates(motion), self.vehicle.layout.positions, x[0])

        h, at = sample.elapsed, x[n:]
        a = rates(at, start)
        b = rates(at + 0.5 * h * a, middle)
        c = rates(at + 0.5 * h * b, middle)
        d = rates(at + h * c, end)
        return jnp.concatenate([x[:n], at + h * (a + 2.0 * b + 2.0 * c + d) / 6.0])

    def observe(self, x: Float[Array, " s"], theta: Float[Array, "0"], sample: Sample) -> Float[Array, " c"]:
        """The vehicle's outputs."""
        return self.vehicle.measure(sample.inputs.time, x, sample.inputs.signals)

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """The difference; angles of a body wrapped to (-π, π]."""
        return self.vehicle.deviation(measured, expected)
