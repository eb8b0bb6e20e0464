"""The state of a plant from what its sensors show: a Kalman filter on the plant itself."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..filter import AbstractProcess, ConstantNoise, ExtendedKalmanFilter, Sample
from ..filter.defaults import DENSITY, state_scale
from .plant import Plant


class Drive(eqx.Module):
    """What a plant takes from a sample: the inputs since the one before, those from it on, and its time, s."""

    before: Float[Array, "*k m"]
    now: Float[Array, "*k m"]
    time: Float[Array, " *k"]


class PlantProcess(AbstractProcess):
    """A plant as filters follow one, without parameters; its state holds what actuators and sensors remember."""

    plant: Plant

    def step(self, x: Float[Array, " s"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " s"]:
        """The plant's step to the sample."""
        return self.plant.step(x, sample.inputs.before, sample.inputs.time - self.plant.dt)

    def observe(self, x: Float[Array, " s"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " c"]:
        """The plant's outputs."""
        return self.plant.output(x, sample.inputs.now, sample.inputs.time)

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """The difference; angles of a body wrapped to (-π, π]."""
        return self.plant.vehicle.deviation(measured, expected)


def observer(plant: Plant, sigma: Float[Array, " c"], strength: float = 1.0) -> ExtendedKalmanFilter:
    """A filter of the plant's state by sensors of noise `sigma` (SI), which knows no more than that noise.

    The vehicle's states stray as `filter.vehicle_filter` lets them, times `strength`; what actuators and sensors
    remember follows from commands and does not.
    """
    scale = state_scale(plant.vehicle, sigma)
    kept = jnp.zeros(len(plant.states) - plant.own, scale.dtype)
    root = jnp.diag(jnp.concatenate([scale, kept]))
    noise = ConstantNoise(strength * DENSITY * root)
    return ExtendedKalmanFilter(PlantProcess(plant), noise, jnp.diag(sigma), root)
