r"""What a predictive controller minimises at one sample, and its limits, to second order.

Over N samples from the state x, with inputs linear between nodes y,
$$J = \tfrac12\sum_k\Delta\Big[\sum_i \big(\tfrac{c_i - c_i^*}{s_i}\big)^2 + \big|\tfrac{u_k - \bar u}{e}\big|^2
+ \big|\tfrac{u_k - u_{k-1}}{\Delta\,d}\big|^2\Big],$$
angles by $2\sin\tfrac12(c - c^*)$. Inputs and their rates keep their limits $g(y) \le 0$, linear in y; channels
yield where they cannot, at a cost of $\tfrac1{2w}\max(0, g)^2$ for g in parts of half their range.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .plant import Plant
from .quadratic import Quadratic


class Weights(eqx.Module):
    """What deviations count for, and what must not be passed.

    **Fields**

    - `track`: channels that follow a reference, and `scale`: (t,) the deviation of each that costs one, SI.
    - `effort`: (m,) deflection from `rest` that costs one; `pace`: (m,) rate of deflection that does, per s.
    - `rest`: (m,) inputs of the plant's own trim.
    - `amplitude`, `rate`: (m,) limits of the inputs, SI and per s.
    - `bounded`: channels within `low` and `high`, (b,); `give`: w.
    - `angles`: for each tracked channel whether it is one.
    """

    track: tuple[str, ...] = eqx.field(static=True)
    scale: Float[Array, " t"]
    effort: Float[Array, " m"]
    pace: Float[Array, " m"]
    rest: Float[Array, " m"]
    amplitude: Float[Array, " m"]
    rate: Float[Array, " m"]
    bounded: tuple[str, ...] = eqx.field(static=True)
    low: Float[Array, " b"]
    high: Float[Array, " b"]
    give: Float[Array, ""]
    angles: tuple[bool, ...] = eqx.field(static=True)


class Task(eqx.Module):
    """The problem at one sample; its variable is y (nodes, m) flat, in amplitudes of the inputs.

    **Fields**

    - `plant`, `weights`: of the controller. `nodes`: the samples at which the inputs are free; between them they are
      linear.
    - `x`: (s,) the state now; `last`: (m,) the inputs until now. `reference`: (N, t) from the next sample on.
    - `time`: s.
    """

    plant: Plant
    weights: Weights
    nodes: tuple[int, ...] = eqx.field(static=True)
    x: Float[Array, " s"]
    last: Float[Array, " m"]
    reference: Float[Array, "n t"]
    time: Float[Array, ""]

    def inputs(self, y: Float[Array, " d"]) -> Float[Array, "n m"]:
        """The inputs at every sample of the horizon."""
        return spread(self.nodes) @ (y.reshape(len(self.nodes), -1) * self.weights.amplitude)

    def predicted(self, y: Float[Array, " d"]) -> tuple[Float[Array, "n t"], Float[Array, "n b"]]:
        """The tracked and the bounded channels at the samples ahead."""
        inputs = self.inputs(y)
        states = self.plant.run(self.x, inputs, self.time)[1:]
        return jax.vmap(self._channels)(states, inputs)

    def limits(self, y: Float[Array, " d"]) -> tuple[Float[Array, " h"], Float[Array, " c"]]:
        """g of the inputs and of their rates at the nodes, and of channels at the samples, in parts of each limit."""
        return self._of_inputs(y), self._of_channels(self.predicted(y)[1])

    def cost(self, y: Float[Array, " d"]) -> Float[Array, ""]:
        """J, and what channels that yield add to it."""
        tracked, bounded = self.predicted(y)
        return self._total(self._deviations(tracked)[0], self._efforts(y), self._of_channels(bounded))

    def expand(self, y: Float[Array, " d"]) -> tuple[Float[Array, ""], Quadratic]:
        """`cost`, and the quadratic program of a Gauss-Newton step."""
        tracked, bounded, by_tracked, by_bounded = self._sensitivities(y)
        deviation, slope = self._deviations(tracked)
        efforts, by_efforts = self._efforts(y), jax.jacfwd(self._efforts)(y)
        by_deviation = (slope[..., None] * by_tracked).reshape(-1, y.size)
        hard, soft = self._of_inputs(y), self._of_channels(bounded)
        # limits are affine in their channels
        by_soft = jax.vmap(self._of_channels, -1, -1)(by_bounded) - self._of_channels(0.0 * bounded)[:, None]
        program = Quadratic(
            by_deviation.T @ by_deviation + by_efforts.T @ by_efforts,
            by_deviation.T @ deviation.ravel() + by_efforts.T @ efforts,
            jnp.concatenate([jax.jacfwd(self._of_inputs)(y), by_soft]),
            jnp.concatenate([hard, soft]),
            jnp.concatenate([jnp.zeros_like(hard), jnp.broadcast_to(self.weights.give, soft.shape)]),
        )
        return self._total(deviation, efforts, soft), program

    def _total(self, deviation: Array, efforts: Array, soft: Array) -> Float[Array, ""]:
        past = jnp.maximum(soft, 0.0)
        return 0.5 * (jnp.sum(deviation**2) + jnp.sum(efforts**2) + jnp.sum(past**2) / self.weights.give)

    def _channels(self, x: Array, u: Array) -> tuple[Array, Array]:
        known = self.plant.channels(x, u, self.time)
        pick = lambda names: jnp.stack([jnp.asarray(known[n]) for n in names]) if names else jnp.zeros(0, x.dtype)
        return pick(self.weights.track), pick(self.weights.bounded)

    def _sensitivities(self, y: Array) -> tuple[Array, Array, Array, Array]:
        """What `predicted` gives, and its Jacobians by y: the steps' own, all at once, then one recursion."""
        inputs, plant = self.inputs(y), self.plant
        states = plant.run(self.x, inputs, self.time)
        times = self.time + plant.dt * jnp.arange(len(inputs), dtype=y.dtype)
        by_state, by_input = jax.vmap(jax.jacfwd(plant.step, (0, 1)))(states[:-1], inputs, times)
        moved = jax.jacfwd(self.inputs)(y)

        def on(column: Array, part: tuple[Array, Array]) -> tuple[Array, Array]:
            after = part[0] @ column + part[1]
            return after, after

        pushed = jnp.einsum("nsm,nmd->nsd", by_input, moved)
        _, columns = jax.lax.scan(on, jnp.zeros_like(pushed[0]), (by_state, pushed))
        tracked, bounded = jax.vmap(self._channels)(states[1:], inputs)
        # a channel by an input, such as one of an actuator, is none that anybody steers by
        of_tracked, of_bounded = jax.vmap(jax.jacfwd(self._channels))(states[1:], inputs)
        chain = lambda slope: jnp.einsum("ncs,nsd->ncd", slope, columns)
        return tracked, bounded, chain(of_tracked), chain(of_bounded)

    def _deviations(self, tracked: Array) -> tuple[Float[Array, "n t"], Float[Array, "n t"]]:
        """Weighted deviations from the reference, and their slopes by the channels."""
        away = tracked - self.reference
        angle = jnp.array(self.weights.angles)
        weight = jnp.sqrt(self.plant.dt) / self.weights.scale
        bent = jnp.where(angle, 2.0 * jnp.sin(0.5 * away), away)
        return weight * bent, weight * jnp.where(angle, jnp.cos(0.5 * away), 1.0)

    def _efforts(self, y: Array) -> Float[Array, " e"]:
        inputs, root = self.inputs(y), jnp.sqrt(self.plant.dt)
        changes = jnp.diff(inputs, axis=0, prepend=self.last[None]) / self.plant.dt
        away = (inputs - self.weights.rest) / self.weights.effort
        return root * jnp.concatenate([away.ravel(), (changes / self.weights.pace).ravel()])

    def _of_inputs(self, y: Array) -> Float[Array, " g"]:
        gaps = jnp.diff(jnp.array(self.nodes), prepend=-1).astype(y.dtype)[:, None]
        size = y.reshape(len(self.nodes), -1)
        most = self.weights.rate * self.plant.dt * gaps / self.weights.amplitude
        turned = jnp.diff(size, axis=0, prepend=(self.last / self.weights.amplitude)[None]) / most
        return jnp.concatenate([(side * part - 1.0).ravel() for part in (size, turned) for side in (1.0, -1.0)])

    def _of_channels(self, bounded: Array) -> Float[Array, " g"]:
        half = 0.5 * (self.weights.high - self.weights.low)
        above, below = (bounded - self.weights.high) / half, (self.weights.low - bounded) / half
        return jnp.concatenate([above.ravel(), below.ravel()])


def spread(nodes: tuple[int, ...]) -> Float[Array, "n k"]:
    """Weights of the values at `nodes` in those at every sample up to the last of them: linear between."""
    samples = jnp.arange(nodes[-1] + 1, dtype=float)
    return jax.vmap(lambda unit: jnp.interp(samples, jnp.array(nodes, float), unit), out_axes=1)(jnp.eye(len(nodes)))
