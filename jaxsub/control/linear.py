r"""A plant linearised about a point: $\delta x_{k+1} = A\,\delta x_k + B\,\delta u_k$, or rates in continuous time."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..errors import InputError
from ..methods import jittable
from ..programs import compiled
from ..vehicle.base import stack
from .plant import Plant, PlantJacobians, Time


class LinearPlant(eqx.Module):
    """Matrices, the point about which they hold, and names.

    **Fields**

    - `A`: (s, s) SI, `B`: (s, m) SI, `C`: (c, s) SI and `D`: (c, m) SI: of deviations from the point.
    - `x`: (s,) SI and `u`: (m,) SI, the point; `y`: (c,) the outputs there, SI.
    - `drift`: (s,) what the state does there, by which the model is affine: its change in a sample, or its rate, SI. A
      trim has drift in place and heading alone.
    - `dt`: s between samples; zero for rates in continuous time.
    - `states`, `inputs`, `outputs`: names.
    """

    A: Float[Array, "s s"]
    B: Float[Array, "s m"]
    C: Float[Array, "c s"]
    D: Float[Array, "c m"]
    x: Float[Array, " s"]
    u: Float[Array, " m"]
    y: Float[Array, " c"]
    drift: Float[Array, " s"]
    dt: float = eqx.field(static=True)
    states: tuple[str, ...] = eqx.field(static=True)
    inputs: tuple[str, ...] = eqx.field(static=True)
    outputs: tuple[str, ...] = eqx.field(static=True)

    @jittable
    def step(self, x: Float[Array, " s"], u: Float[Array, " m"]) -> Float[Array, " s"]:
        """The next state by the linear model; of a continuous one the rate."""
        moved = self.A @ (x - self.x) + self.B @ (u - self.u) + self.drift
        return moved + self.x if self.dt else moved

    @jittable
    def output(self, x: Float[Array, " s"], u: Float[Array, " m"]) -> Float[Array, " c"]:
        """The outputs by the linear model."""
        return self.y + self.C @ (x - self.x) + self.D @ (u - self.u)


@compiled
def linearise(plant: Plant, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> LinearPlant:
    """The sampled `plant` linearised about a point, such as a trim: exact derivatives of its step and outputs.

    `x` (s,) is the state and `u` (m,) the inputs at the point, SI, and `time` that of the sample, s.
    """
    drift = plant.step(x, u, time) - x
    return _named(plant, plant.jacobians(x, u, time), x, u, plant.output(x, u, time), drift, plant.dt)


def linearise_rates(plant: Plant, x: Float[Array, " s"], u: Float[Array, " m"], time: Time = 0.0) -> LinearPlant:
    """The model of which `plant` is the sampled form, in continuous time, linearised about a point.

    `x` (s,) is the state and `u` (m,) the inputs at the point, SI, and `time` in s.

    **Raises** `InputError` for a plant in whose state actuators or sensors keep samples: these have no rate.
    """
    if any(plant.sizes):
        kept = ", ".join(plant.states[plant.own :])
        raise InputError(plant.vehicle.layout.name, f"keeps samples ({kept})", "linearise its step instead")
    return _rates_about(plant, x, u, time)


@compiled
def _rates_about(plant: Plant, x: Array, u: Array, time: Time) -> LinearPlant:
    def rates(x: Array, u: Array) -> Array:
        signals = plant.acting(u, time)
        moved = plant.vehicle.position_rates(plant.vehicle.motion(x, signals))
        positions = stack(moved, plant.vehicle.layout.positions, x[0])
        return jnp.concatenate([plant.vehicle.acceleration(x, signals), positions])

    by_state, by_input = jax.jacfwd(rates, (0, 1))(x, u)
    shown = plant.jacobians(x, u, time)
    return _named(plant, shown._replace(A=by_state, B=by_input), x, u, plant.output(x, u, time), rates(x, u), 0.0)


def _named(plant: Plant, of: PlantJacobians, x: Array, u: Array, y: Array, drift: Array, dt: float) -> LinearPlant:
    names = (plant.states, plant.inputs, plant.outputs)
    return LinearPlant(of.A, of.B, of.C, of.D, x, u, y, drift, dt, *names)


def linearisation_error(
    plant: Plant, linear: LinearPlant, inputs: Float[Array, "k m"], time: Time = 0.0
) -> Float[Array, " s"]:
    """The largest deviation of each state, SI, of a sampled `linear` from `plant` under `inputs` from its point.

    **Raises** `InputError` for a linear plant in continuous time.
    """
    if not linear.dt:
        raise InputError(plant.vehicle.layout.name, "is linear in continuous time", "compare that of linearise")
    return _apart(plant, linear, inputs, time)


@compiled
def _apart(plant: Plant, linear: LinearPlant, inputs: Array, time: Time) -> Float[Array, " s"]:
    def on(x: Array, u: Array) -> tuple[Array, Array]:
        after = linear.step(x, u)
        return after, after

    straight = jax.lax.scan(on, linear.x, inputs)[1]
    return jnp.max(jnp.abs(plant.run(linear.x, inputs, time)[1:] - straight), axis=0)
