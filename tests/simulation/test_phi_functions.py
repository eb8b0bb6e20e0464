"""phi_functions are the blocks of SciPy's exponential of one block matrix, also for singular and stiff matrices."""

import jax
import numpy as np
import pytest
from scipy.linalg import expm

from jaxsub.simulation import phi_functions

rng = np.random.default_rng(1)
nilpotent = np.diag(np.ones(3), 1)
singular = rng.normal(size=(4, 3)) @ rng.normal(size=(3, 4))
stiff = np.diag([-1500.0, -30.0, -1e-3, 0.0]) + np.diag([200.0, 3.0, 1e-3], 1)
rotating = 40.0 * np.kron(np.eye(2), [[0.0, 1.0], [-1.0, 0.0]])
CASES = {
    "random": rng.normal(size=(4, 4)),
    "zero": np.zeros((4, 4)),
    "nilpotent": nilpotent,
    "singular": singular,
    "stiff": stiff,
    "rotating": rotating,
    "tiny": 1e-9 * singular,
}


@pytest.mark.parametrize("name", CASES)
def test_phi_functions_are_blocks_of_the_exponential(name):
    A, eye, zero = CASES[name], np.eye(4), np.zeros((4, 4))
    rows = [[A, eye, zero, zero], [zero, zero, eye, zero], [zero, zero, zero, eye], [zero, zero, zero, zero]]
    expected = expm(np.block(rows))[:4].reshape(4, 4, 4).swapaxes(0, 1)
    for found, block in zip(jax.jit(phi_functions)(A), expected, strict=True):
        np.testing.assert_allclose(found, block, rtol=0.0, atol=2e-11 * max(1.0, np.abs(block).max()))
