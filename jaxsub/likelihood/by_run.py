"""What each run has of the products of whitened columns, and constants of each run as states of a linearised model."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..programs import compiled
from .disturbance import Columns, Disturbance, System, steps
from .innovation_products import products_by_part


@compiled
def run_products(
    disturbance: Disturbance, system: System, columns: Columns, few: int
) -> tuple[Float[Array, "q q"], Float[Array, "r f q"], Float[Array, ""]]:
    """`total_products`, and between them what each run has of the products of the first `few` columns with all.

    Of all `columns`, whitened under `disturbance` on `system`.
    """
    gram, log_determinant = products_by_part(*steps(disturbance, system, columns), 1)
    return jnp.sum(gram, (0, 1)), gram[:, 0, :few], jnp.sum(log_determinant)


def with_constants(system: System, columns: Columns, std: Float[np.ndarray, " v"]) -> System:
    """The `system` with v constants of each run as states more, of prior standard deviations `std`.

    Each does what one of the v `columns` does per unit of it. Not to be called in `jit`.
    """
    v = len(std)
    A, G, C, start_std = map(np.asarray, (system.A, system.G, system.C, system.start_std))
    still = np.broadcast_to(np.eye(v), (*A.shape[:2], v, v))
    below = np.concatenate([np.zeros((*A.shape[:2], v, A.shape[-1])), still], axis=-1)
    A = np.concatenate([np.concatenate([A, np.asarray(columns.forcing)], axis=-1), below], axis=-2)
    G = np.pad(G, [(0, 0), (0, 0), (0, v), (0, 0)])
    C = np.concatenate([C, np.asarray(columns.shown)], axis=-1)
    A, G, C, start_std = jax.device_put((A, G, C, np.concatenate([start_std, std])))
    return dataclasses.replace(system, A=A, G=G, C=C, start_std=start_std)
