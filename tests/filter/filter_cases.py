"""Processes small enough that the tests can write their filters out by hand."""

import jax
import jax.numpy as jnp
import numpy as np

from jaxsub.filter.model import AbstractProcess, Sample


class Linear(AbstractProcess):
    """x ← F x + u, z = C x."""

    F: jax.Array
    C: jax.Array

    def step(self, x, theta, sample):
        return self.F @ x + sample.inputs

    def observe(self, x, theta, sample):
        return self.C @ x


class Spring(AbstractProcess):
    """A mass on a spring of stiffness θ₁ and damping θ₂ by Euler's rule; measured: x and 2x + its rate."""

    def step(self, x, theta, sample):
        rate = sample.inputs[0] - theta[0] * x[0] - theta[1] * x[1]
        return jnp.stack([x[0] + 0.1 * x[1], x[1] + 0.1 * rate])

    def observe(self, x, theta, sample):
        return jnp.stack([x[0], 2.0 * x[0] + x[1]])


class Driven(AbstractProcess):
    """One state that settles to a sum of inputs, θ their weights; the state is measured."""

    def step(self, x, theta, sample):
        return x + 0.1 * (sample.inputs @ theta - 0.5 * x)

    def observe(self, x, theta, sample):
        return x


def sequence(inputs, outputs, mask=None, dtype=jnp.float64):
    """Samples a second apart."""
    mask = np.ones(outputs.shape, bool) if mask is None else mask
    elapsed = jnp.ones(len(outputs), dtype)
    return Sample(jnp.asarray(inputs, dtype), elapsed, jnp.asarray(outputs, dtype), jnp.asarray(mask))


def at(samples, *index):
    """One of many samples."""
    return jax.tree.map(lambda leaf: leaf[index], samples)


def alone(samples):
    """Samples of one run as those of many."""
    return jax.tree.map(lambda leaf: leaf[None], samples)
