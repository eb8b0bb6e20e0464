"""A vehicle as a process that filters follow: its state in SI, its free parameters in the estimator's coordinates."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..effects import AbstractActuator, AbstractEffect, AbstractSensor
from ..errors import InputError
from ..parameters import Transform
from ..recording.runs import Runs
from ..simulation import Sampled, step_table
from ..vehicle import AbstractVehicle
from .model import AbstractProcess, Sample


class Drive(eqx.Module):
    """What a vehicle takes from a sample.

    **Fields**

    - `nodes`: (3, m + 1) signals, SI, and time, s, at the start, middle and end of the interval before it.
    - `time`: s from the start of the run. `signals`: (m,) at the sample, SI.
    """

    nodes: Float[Array, "*k 3 m1"]
    time: Float[Array, " *k"]
    signals: Float[Array, "*k m"]


def unfilterable(vehicle: AbstractVehicle) -> list[AbstractEffect]:
    """Effects on actuators and delays of sensors, whose memory is no part of the state that a filter follows."""
    late = lambda effect: isinstance(effect, AbstractSensor) and effect.remembers
    return [effect for effect in vehicle.effects if isinstance(effect, AbstractActuator) or late(effect)]


class VehicleProcess(AbstractProcess):
    r"""The sampled step of a vehicle and what its sensors show, $\theta$ the free parameters by `transform`.

    **Fields**

    - `vehicle`: what is not free. `transform`: between its free parameters and $\theta$.
    - `substeps`: steps in each sample interval.

    **Raises** `InputError` for effects that are `unfilterable`.
    """

    vehicle: AbstractVehicle
    transform: Transform
    substeps: int = eqx.field(static=True, default=1)

    def __check_init__(self):
        for effect in unfilterable(self.vehicle):
            remedy = "filter without it, or fit by the output error"
            raise InputError(self.vehicle.layout.name, f"a filter cannot hold the memory of {effect.label}", remedy)

    @classmethod
    def of(cls, vehicle: AbstractVehicle, substeps: int = 1) -> "VehicleProcess":
        """`vehicle`, with coordinates about its free parameters, by so many `substeps` in a sample interval."""
        values = vehicle.values()
        theta = np.array([float(values[row.name]) for row in vehicle.layout.free])
        return cls(vehicle, Transform.of(vehicle.layout.free, theta), substeps)

    def coordinates(self) -> Float[Array, " p"]:
        """The coordinates of the vehicle's own free parameters."""
        values = self.vehicle.values()
        return self.transform.to_free(jnp.asarray([values[row.name] for row in self.vehicle.layout.free]))

    def vehicle_at(self, theta: Float[Array, " p"]) -> AbstractVehicle:
        """The vehicle whose free parameters have the coordinates `theta`."""
        names = [row.name for row in self.vehicle.layout.free]
        return self.vehicle.with_values(dict(zip(names, self.transform.to_physical(theta), strict=True)))

    def step(
        self,
        x: Float[Array, " s"],
        theta: Float[Array, " p"],
        sample: Sample,
        push: Float[Array, "2 n"] | None = None,
    ) -> Float[Array, " s"]:
        """The sampled step for these parameters, under the extra force `push` (2, n), N or N m, if given.

        `push` acts at the start and the end of the interval, and linearly between. The step's value is that of
        `Sampled`. Its derivative by the parameters is good to the scheme's order: they move the linear part as a force
        and not through the matrix exponential, whose derivatives would cost more than all else.
        """
        vehicle = self.vehicle_at(theta)
        inverse = jnp.linalg.inv(vehicle.mass_matrix())
        linear = inverse @ vehicle.damping_matrix()
        frozen = jax.lax.stop_gradient(linear)
        table = step_table(frozen, sample.elapsed[None] / self.substeps)
        sampled = Sampled(vehicle, inverse, table, self.substeps, linear - frozen)
        return sampled.step(x, sample.inputs.nodes, jnp.asarray(0), push)

    def observe(self, x: Float[Array, " s"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, " c"]:
        """The vehicle's outputs."""
        return self.vehicle_at(theta).measure(sample.inputs.time, x, sample.inputs.signals)

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """The difference; angles of a body wrapped to (-π, π]."""
        return self.vehicle.deviation(measured, expected)


def samples(runs: Runs) -> Sample:
    """The samples of `runs`, (R, K) of them, as a `VehicleProcess` takes them."""
    first = lambda rest: jnp.concatenate([jnp.zeros_like(rest[:, :1]), rest], axis=1)
    elapsed = first(jnp.where(runs.live, runs.steps[runs.step_of], 0.0))
    return Sample(Drive(first(runs.nodes()), runs.times, runs.signals), elapsed, runs.outputs, runs.mask)
