"""How wide a pool of searches is: by what the device that JAX picks can hold."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, oscillator, stacked

from jaxsub.errors import InputError
from jaxsub.estimate import Problem
from jaxsub.estimate.method import bytes_of_a_lane, lanes_for, share_for, shares_at_once
from jaxsub.simulation import synthetic


def test_a_pool_on_an_accelerator_is_as_wide_as_half_its_memory_and_has_it_to_itself(monkeypatch):
    """Claim: 256 lanes where memory allows, fewer where it does not, one pool; and no C there, in one clear line."""
    vehicle = oscillator()
    runs = stacked(vehicle, synthetic(vehicle, [driven(vehicle, 0.1 * np.arange(40), seed=0)], seed=4), 1)
    made = Problem.of(vehicle, runs, jnp.full(runs.outputs.shape[-1], 0.02))
    narrow, cores = lanes_for(made), shares_at_once()
    memory = lambda size: monkeypatch.setattr(
        jax, "local_devices", lambda: [SimpleNamespace(memory_stats=lambda: {"bytes_limit": size})]
    )
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    memory(10**11)
    assert (lanes_for(made), shares_at_once()) == (256, 1)
    assert share_for(made) > 256
    memory(20 * bytes_of_a_lane(made))
    assert lanes_for(made) == 10
    with pytest.raises(InputError, match="JAX_PLATFORMS=cpu"):
        made.in_c()
    monkeypatch.undo()
    assert (lanes_for(made), shares_at_once()) == (narrow, cores)
    assert narrow <= 8
