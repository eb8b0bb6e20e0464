"""The model's answer at the samples of recordings."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..programs import compiled
from ..recording.runs import Runs
from ..vehicle import AbstractVehicle
from ..vehicle.base import stack
from .exponential import StepTable, exponential_step, step_table


class Sampled(eqx.Module):
    """A vehicle made ready to step: its inverse inertia and the weights of every step length.

    **Fields**

    - `vehicle`: the model.
    - `inverse`: (n, n) inverse of the inertia matrix, SI.
    - `table`: weights of the distinct steps of some runs.
    - `substeps`: steps in each sample interval.
    - `rest`: (n, n) what the linear part has beyond that of `table`, 1/s; it acts as a force does.
    """

    vehicle: AbstractVehicle
    inverse: Float[Array, "n n"]
    table: StepTable
    substeps: int = eqx.field(static=True)
    rest: Float[Array, "n n"] | None = None

    @classmethod
    def of(cls, vehicle: AbstractVehicle, runs: Runs) -> "Sampled":
        """`vehicle` made ready for the step lengths of `runs`."""
        inverse = jnp.linalg.inv(vehicle.mass_matrix())
        table = step_table(inverse @ vehicle.damping_matrix(), runs.steps / runs.substeps)
        return cls(vehicle, inverse, table, runs.substeps)

    def rates(
        self,
        velocity: Float[Array, " n"],
        position: Float[Array, " m"],
        signals: Float[Array, " u"],
        extra: Float[Array, " n"] | float = 0.0,
    ) -> tuple[Float[Array, " n"], Float[Array, " m"]]:
        """Rates of the `velocity` (n,), without its linear part, and of the `position` (m,), SI.

        `signals` (u,) are the inputs, SI, and `extra` (n,) a generalised force more, N or N m.
        """
        motion = self.vehicle.motion(jnp.concatenate([velocity, position]), signals)
        moved = stack(self.vehicle.position_rates(motion), self.vehicle.layout.positions, velocity[0])
        rate = self.inverse @ (self.vehicle.force(motion) + extra)
        return rate if self.rest is None else rate + self.rest @ velocity, moved

    def step(
        self,
        state: Float[Array, " s"],
        nodes: Float[Array, "3 m"],
        index: Array,
        push: Float[Array, "2 n"] | None = None,
    ) -> Float[Array, " s"]:
        """The `state` (s,), SI, one sample later.

        `nodes` (3, m) are the inputs at the start, middle and end of the interval, SI. `index` says which step length;
        `push` (2, n) is an extra generalised force (N, N m) at the start and end of the interval, linear between: the
        port through which a diagnosis asks what a missing force would do.
        """
        n = self.inverse.shape[0]
        extra = None if push is None else jnp.stack([push[0], 0.5 * (push[0] + push[1]), push[1]])
        full = nodes if extra is None else jnp.concatenate([nodes, extra], axis=1)
        weights = self.table.at(index)

        # compiled apart so that the four stages of a step, and their derivatives, are traced once and not four times
        @jax.jit
        def rates(velocity: Array, position: Array, node: Array) -> tuple[Array, Array]:
            signals, force = (node, 0.0) if extra is None else (node[:-n], node[-n:])
            return self.rates(velocity, position, signals, force)

        def advance(carry: tuple[Array, Array], part: Array) -> tuple[tuple[Array, Array], None]:
            return exponential_step(rates, weights, *carry, part), None

        carry = (state[:n], state[n:])
        if self.substeps == 1:
            carry, _ = advance(carry, full)
        else:
            carry, _ = jax.lax.scan(advance, carry, subdivided(full, self.substeps))
        return jnp.concatenate(carry)

    def states(
        self, runs: Runs, start: Float[Array, "r s"], push: Float[Array, "r k1 2 n"] | None = None
    ) -> Float[Array, "r k s"]:
        """States at the samples of `runs` from the initial states `start`, under `push` in each interval if given."""
        nodes = jax.vmap(self.vehicle.actuate)(runs.times, runs.nodes())

        def advance(state: Array, interval: tuple[Array, Array, Array, Array | None]) -> tuple[Array, Array]:
            node, index, live, push = interval
            after = jnp.where(live, self.step(state, node, index, push), state)
            return after, after

        def run(state: Array, node: Array, index: Array, live: Array, push: Array | None) -> Array:
            return jnp.concatenate([state[None], jax.lax.scan(advance, state, (node, index, live, push))[1]])

        return jax.vmap(run)(start, nodes, runs.step_of, runs.live, push)


def parabola(s: Float[Array, " *k"]) -> Float[Array, "*k 3"]:
    """Weights of the signals at the start, middle and end of an interval at the fraction `s` of it."""
    return jnp.stack([(1.0 - s) * (1.0 - 2.0 * s), 4.0 * s * (1.0 - s), s * (2.0 * s - 1.0)], axis=-1)


def subdivided(nodes: Float[Array, "3 m"], parts: int) -> Float[Array, "q 3 m"]:
    """Nodes of `parts` equal pieces of the interval, on the parabola through the three given."""
    fine = parabola(jnp.arange(2 * parts + 1, dtype=nodes.dtype) / (2.0 * parts)) @ nodes
    return fine[2 * jnp.arange(parts)[:, None] + jnp.arange(3)]


def simulate(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Float[Array, "r k c"]:
    """What the sensors of `vehicle` show at the samples of `runs`, noise apart, from the initial states `start`."""
    return measure(vehicle, runs, sampled_states(vehicle, runs, start))


# whatever needs a trajectory has this program of it, since a loop over samples takes long to compile
@compiled
def sampled_states(vehicle: AbstractVehicle, runs: Runs, start: Float[Array, "r s"]) -> Float[Array, "r k s"]:
    """States (R, K, s), SI, of `vehicle` at the samples of `runs` by the sampled step.

    `start` (R, s) are the initial states, SI. `integrate` gives them by the continuous model.
    """
    return Sampled.of(vehicle, runs).states(runs, start)


@compiled
def measure(vehicle: AbstractVehicle, runs: Runs, states: Float[Array, "r k s"]) -> Float[Array, "r k c"]:
    """Outputs (R, K, c), SI, of the sensors of `vehicle` along `states` (R, K, s) at the samples of `runs`.

    The actuators' own dynamics are seen only through what they did.
    """
    return vehicle.measure(runs.times, states, runs.signals)
