r"""A vehicle under Gauss–Markov disturbance forces, as a process that filters follow.

The state is [x, d] with a first-order Gauss–Markov force in every equation (Gelb 1974, Applied Optimal Estimation, ch.
2): $d_{k+1} = \rho_k d_k + q\sqrt{1-\rho_k^2}\,w_k$, $\rho_k = e^{-\Delta_k/\tau}$. Its innovations are white where the
vehicle is right and the disturbance as strong and as slow as assumed.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .ekf import ExtendedKalmanFilter
from .gate import AbstractGate, Open
from .model import AbstractProcess, Sample
from .noise import ConstantNoise
from .vehicle import VehicleProcess


class DisturbedProcess(AbstractProcess):
    """The vehicle of `process`, its parameters known, and a disturbance force in each of its n equations.

    **Fields**

    - `process`: the vehicle alone.
    - `force`, `time`: (n,) standard deviation (N, N m) and time constant (s) of the force in each equation.
    """

    process: VehicleProcess
    force: Float[Array, " n"]
    time: Float[Array, " n"]

    def _parts(self, z: Float[Array, " z"]) -> tuple[Float[Array, " s"], Float[Array, " n"]]:
        states = z.size - self.force.size
        return z[:states], z[states:]

    def _kept(self, elapsed: Float[Array, ""]) -> Float[Array, " n"]:
        return jnp.exp(-elapsed / self.time)

    def pushed(self, z: Float[Array, " z"], sample: Sample, push: Float[Array, "2 n"]) -> Float[Array, " z"]:
        """The state [x, d] at `sample` from `z` (z,), SI, under `push` (2, n), N or N m, beside the disturbance.

        `push` acts at the start and the end of the interval, and linearly between.
        """
        x, d = self._parts(z)
        later = self._kept(sample.elapsed) * d
        moved = self.process.step(x, self.process.coordinates(), sample, jnp.stack([d, later]) + push)
        return jnp.concatenate([moved, later])

    def step(self, x: Float[Array, " z"], theta: Float[Array, "0"], sample: Sample) -> Float[Array, " z"]:
        """The state [x, d] at `sample`; there are no parameters."""
        return self.pushed(x, sample, jnp.zeros((2, self.force.size), x.dtype))

    def observe(self, x: Float[Array, " z"], theta: Float[Array, "0"], sample: Sample) -> Float[Array, " c"]:
        """The vehicle's outputs, which do not see the force."""
        return self.process.observe(self._parts(x)[0], self.process.coordinates(), sample)

    def driven(
        self, x: Float[Array, " z"], theta: Float[Array, "0"], sample: Sample, root: Float[Array, "z m"]
    ) -> Float[Array, "z k"]:
        """`root`, and what drives the force in the interval, which also moves the vehicle until its end."""
        fresh = self.force * jnp.sqrt(-jnp.expm1(-2.0 * sample.elapsed / self.time))
        zero = jnp.zeros((2, self.force.size), x.dtype)
        by_end = lambda end: self.pushed(x, sample, zero.at[1].set(end))
        push = jax.linearize(by_end, zero[1])[1]
        count = self.force.size
        moved = jax.vmap(push, out_axes=1)(jnp.eye(count, dtype=x.dtype))
        return jnp.concatenate([root, moved.at[-count:].add(jnp.eye(count, dtype=x.dtype)) * fresh], axis=1)

    def innovation(self, measured: Float[Array, " c"], expected: Float[Array, " c"]) -> Float[Array, " c"]:
        """The difference; angles of a body wrapped to (-π, π]."""
        return self.process.innovation(measured, expected)


def disturbed_filter(
    process: DisturbedProcess,
    sigma: Float[Array, " c"],
    start_std: Float[Array, " s"],
    density: Float[Array, " s"] | None = None,
    gate: AbstractGate | None = None,
) -> ExtendedKalmanFilter:
    """The filter of a `process`, whose sensors have the noise `sigma` (c,), SI.

    `start_std` (s,) are standard deviations of an initial state, SI. `density` (s,) is the root of white noise of the
    vehicle's states, per root second, by default none. `gate` says which measurements are believed, by default all.
    """
    force = process.force
    white = jnp.zeros_like(start_std) if density is None else density
    noise = ConstantNoise(jnp.diag(jnp.concatenate([white, jnp.zeros_like(force)])))
    x_root = jnp.diag(jnp.concatenate([start_std, force]))
    return ExtendedKalmanFilter(process, noise, jnp.diag(sigma), x_root, gate=gate or Open())
