"""Tracks from fixes alone: on from the last two at their velocity, and a filter of a mass that is pushed at random."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsub.filter import AbstractProcess, ConstantNoise, ExtendedKalmanFilter, Sample

# m/s²/√Hz: the quadrotor accelerates by some 3 m/s² for some 0.7 s
_PUSH = 3.0


class ConstantVelocity(AbstractProcess):
    """State: position and velocity, of which the position is measured."""

    def step(self, x: Float[Array, "6"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "6"]:
        """On at the velocity."""
        return jnp.concatenate([x[:3] + sample.elapsed * x[3:], x[3:]])

    def observe(self, x: Float[Array, "6"], theta: Float[Array, " p"], sample: Sample) -> Float[Array, "3"]:
        """The position."""
        return x[:3]


class Track:
    """A track that can be evaluated at any time, by the fixes up to then: from the last of them on at a velocity."""

    def __init__(self, times: np.ndarray, positions: np.ndarray, velocities: np.ndarray):
        self.times, self.positions, self.velocities = times, positions, velocities

    def at(self, times: np.ndarray) -> np.ndarray:
        """(K, 3) by the fixes up to each time."""
        return self._on(times, np.maximum(np.searchsorted(self.times, times, side="right") - 1, 0))

    def without_fixes(self, times: np.ndarray, since: float) -> np.ndarray:
        """(K, 3) by the fixes up to `since`."""
        return self._on(times, np.full(len(times), np.searchsorted(self.times, since, side="right") - 1))

    def _on(self, times: np.ndarray, last: np.ndarray) -> np.ndarray:
        return self.positions[last] + (times - self.times[last])[:, None] * self.velocities[last]


def last_two_fixes(times: np.ndarray, fixes: np.ndarray) -> Track:
    """At the velocity between the last two fixes: the paper's position filter with GPS for its log."""
    between = np.diff(fixes, axis=0) / np.diff(times)[:, None]
    return Track(times, fixes, np.concatenate([np.zeros((1, 3)), between]))


def constant_velocity(times: np.ndarray, fixes: np.ndarray, std: np.ndarray) -> Track:
    """Kalman's filter of `ConstantVelocity` with fixes of deviations `std`."""
    push = ConstantNoise(_PUSH * jnp.eye(6)[:, 3:])
    first = jnp.diag(jnp.concatenate([jnp.asarray(std), jnp.full(3, 5.0)]))
    filter = ExtendedKalmanFilter(ConstantVelocity(), push, jnp.diag(jnp.asarray(std)), first)
    elapsed = jnp.asarray(np.diff(times, prepend=times[0]))
    samples = Sample(jnp.zeros((len(times), 0)), elapsed, jnp.asarray(fixes), jnp.ones(fixes.shape, bool))
    x = np.asarray(_filtered(filter, samples))
    return Track(times, x[:, :3], x[:, 3:])


@eqx.filter_jit
def _filtered(filter: ExtendedKalmanFilter, samples: Sample) -> jax.Array:
    at = jnp.concatenate([samples.outputs[0], jnp.zeros(3)])
    state = filter.start(at, jnp.zeros(0), jnp.zeros((0, 0)))
    return jax.lax.scan(lambda state, sample: filter.step(state, sample), state, samples)[1].x
