r"""Signatures of changes in the innovations of a filter, and the generalised likelihood ratio of each.

A constant force in an equation, or a constant bias of a sensor, that sets in at a time $\kappa$ shifts the whitened
innovations $e_k$ by its size times a signature $w_k$, which follows from the filter's own gains:

$D_k^- = F_kD_{k-1} + f_k,\quad w_k = L_k^{-1}(C_kD_k^- + o),\quad D_k = D_k^- - K_kL_kw_k$

with D the deviation of the true state from the estimate for a change of unit size. The likelihood ratio of the change,
maximised over its size, is $z^2/2$ with $z = \sum w_ke_k/\sqrt{\sum w_k^2}$, and $z^2$ is $\chi^2_1$ without a change.
The unknown $\kappa$ is searched over windows: window m begins anew every $8\cdot2^m$ samples, out of step with others.

Source: Willsky and Jones (1976), IEEE Trans. Automatic Control 21; Lai (1995), J. R. Statist. Soc. B 57.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Bool, Float, Int

# samples of the shortest window
_SHORTEST = 8
# the fraction of its length by which a window is out of step with the one before: as far from commensurable as can be
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


class Linearisation(NamedTuple):
    """A filter about a sample, z numbers of state, c channels, n equations.

    **Fields**

    - `F`: (z, z) of the step to the sample by the state; `force`: (z, n) by a force that acts throughout it, N or N m.
    - `C`: (c, z) of the channels by the state, SI; `gain`: (z, c) of the correction, zero where nothing was used.
    - `factor`: (c, c) lower-triangular factor of the innovation's covariance; `used`: (c,) channels that were used.
    """

    F: Float[Array, "*k z z"]
    force: Float[Array, "*k z n"]
    C: Float[Array, "*k c z"]
    gain: Float[Array, "*k z c"]
    factor: Float[Array, "*k c c"]
    used: Bool[Array, "*k c"]


class Signatures(eqx.Module):
    """The signatures of n + c changes in M windows.

    **Fields**

    - `D`: (M, z, n + c) deviations of the state for a change of unit size: N or N m, and the channel's sigma.
    - `age`: (M,) samples since each window began. `information`: (M, n + c) sums of squares of the whitened
      signatures.
    """

    D: Float[Array, "m z q"]
    age: Int[Array, " m"]
    information: Float[Array, "m q"]

    @classmethod
    def start(cls, windows: int, states: int, changes: int) -> "Signatures":
        """Before the first sample, of so many `windows`, `states` and `changes`; the windows are out of step."""
        begun = [int(length * (_GOLDEN * m % 1.0)) for m, length in enumerate(window_lengths(windows))]
        age = jnp.asarray(begun, jnp.int32)
        return cls(jnp.zeros((windows, states, changes)), age, jnp.zeros((windows, changes)))

    def after(
        self, at: Linearisation, sigma: Float[Array, " c"]
    ) -> tuple["Signatures", Float[Array, "m c q"], Bool[Array, " m"]]:
        """The signatures after a sample; what they are in it, (M, c, n + c); and which windows begin with it.

        `at` is the filter about the sample, and `sigma` (c,) the unit of the sensors' biases, SI.
        """
        n, c = at.force.shape[-1], sigma.size
        fresh = self.age >= jnp.asarray(window_lengths(len(self.age)))
        D = jnp.where(fresh[:, None, None], 0.0, self.D)
        forcing = jnp.pad(at.force, ((0, 0), (0, c)))
        shown = jnp.pad(jnp.diag(sigma), ((0, 0), (n, 0)))
        predicted = at.F @ D + forcing
        seen = jnp.where(at.used[:, None], at.C @ predicted + shown, 0.0)
        inverse = solve_triangular(at.factor, jnp.eye(c, dtype=D.dtype), lower=True)
        white = inverse @ seen
        information = jnp.where(fresh[:, None], 0.0, self.information) + jnp.sum(white**2, axis=1)
        age = jnp.where(fresh, 0, self.age) + 1
        return Signatures(predicted - at.gain @ seen, age, information), white, fresh


def window_lengths(count: int) -> Int[np.ndarray, " m"]:
    """Lengths in samples of so many windows, the shortest first."""
    return _SHORTEST * 2 ** np.arange(count)


def windows_for(samples: float) -> int:
    """How many windows there are until one is as long as so many `samples`."""
    return 1 + max(0, math.ceil(math.log2(samples / _SHORTEST)))


def whitened(at: Linearisation, innovation: Float[Array, " c"]) -> Float[Array, " c"]:
    """The `innovation` (c,), SI, in units of its covariance's factor."""
    return solve_triangular(at.factor, jnp.where(at.used, innovation, 0.0), lower=True)


def scored(
    score: Float[Array, "m q"], fresh: Bool[Array, " m"], white: Float[Array, "m c q"], e: Float[Array, " c"]
) -> Float[Array, "m q"]:
    """Products of the signatures with whitened innovations after a further sample.

    `score` (M, q) are those before it, `fresh` (M,) the windows that begin with it, `white` (M, c, q) the signatures in
    it, and `e` (c,) its whitened innovation.
    """
    return jnp.where(fresh[:, None], 0.0, score) + jnp.einsum("mcq,c->mq", white, e)


def squares(
    score: Float[Array, "*b m q"], information: Float[Array, "m q"], variance: Float[Array, "m q"]
) -> Float[Array, "*b m q"]:
    """z² of each change in each window over its `variance` (m, q) without a change; zero where nothing shows it yet."""
    known = information > 0.0
    return jnp.where(known, score**2 / (jnp.where(known, information, 1.0) * variance), 0.0)
