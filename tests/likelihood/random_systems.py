"""Linear systems of random matrices, which tests of what is made of a system start from."""

import jax.numpy as jnp
import numpy as np

from jaxsub.likelihood import System


def random_system(rng: np.random.Generator, measured: np.ndarray, states: int, forces: int) -> System:
    """A system that changes from sample to sample, seen where it is `measured` (R, K, c)."""
    runs, samples, _ = measured.shape
    return System(
        A=jnp.asarray(0.6 * rng.standard_normal((runs, samples - 1, states, states))),
        G=jnp.asarray(rng.standard_normal((runs, samples - 1, states, 2 * forces))),
        C=jnp.asarray(rng.standard_normal((*measured.shape, states)) * measured[..., None]),
        measured=jnp.asarray(measured),
        intervals=jnp.asarray(rng.uniform(0.1, 0.5, (runs, samples - 1))),
        start_std=jnp.ones(states),
    )
