r"""Damped Newton with any curvature: Gauss–Newton by Levenberg and Marquardt, or Newton with the exact Hessian.

A step solves $(|\hat H| + \lambda)\,\hat d = -\hat g$ in coordinates in which the curvature has a unit diagonal
(Marquardt's scaling), so that a coefficient which the data tell ten thousand times better than another is damped no
more than it. $|\hat H|$ has the eigenvalues' absolute values: where the exact Hessian is indefinite a step still goes
downhill. $\lambda$ follows Nielsen (1999), IMM-REP-1999-05.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jax.custom_batching import sequential_vmap
from jaxtyping import Array, Bool, Float

from .problem import Expansion

# a direction with less of the curvature than this is rounding, and says nothing
_FLAT = 1e-13
_FIRST, _LEAST, _MOST = 1e-3, 1e-10, 1e12


class _State(eqx.Module):
    """Where the search is, what it knows there, and what it tries next."""

    fresh: Bool[Array, ""]
    at: Expansion
    trial: Float[Array, " d"]
    promised: Float[Array, ""]
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    decrement: Float[Array, ""]


class Damped(optx.AbstractMinimiser):
    r"""Minimises what `expand(args, y)` gives to second order; the function itself is not called.

    Ends where the full step promises a gain below `tolerance`: $\tfrac12 g^TH^{-1}g$ is half the squared distance to
    the optimum in standard errors, so 1e-5 stops within 0.005 of one, whatever the units. A trial that is not finite
    is refused, so only a start that does not run ends as `nonfinite`; where no step however short is better the search
    ends as `nonlinear_divergence`.
    """

    expand: Callable[[Any, Array], Expansion] = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)
    # largest change of an entry in one step
    longest: float = eqx.field(static=True, default=float("inf"))
    # what optimistix asks every solver for and this one has no use of
    rtol: ClassVar[float] = 0.0
    atol: ClassVar[float] = 0.0
    norm: ClassVar[Callable] = staticmethod(optx.two_norm)

    def init(self, fn: Any, y: Array, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> _State:
        """Nothing is known yet; the start itself is tried first."""
        zero = jnp.zeros((), y.dtype)
        at = Expansion(zero, jnp.zeros_like(y), jnp.zeros((y.size, y.size), y.dtype))
        return _State(jnp.asarray(True), at, y, zero + 1.0, zero + _FIRST, zero + 2.0, zero + jnp.inf)

    def step(self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any) -> tuple[Array, _State, None]:
        """Evaluate the trial, move there if it is better, and choose the next."""
        new = self.expand(args, state.trial)
        gain = (state.at.cost - new.cost) / state.promised
        finite = jnp.isfinite(new.cost) & jnp.all(jnp.isfinite(new.hessian)) & jnp.all(jnp.isfinite(new.gradient))
        good = finite & (state.fresh | (gain > 0.0))
        chosen = lambda a, b: jnp.where(good, a, b)
        at = jax.tree.map(chosen, new, state.at)
        shrink = jnp.maximum(1.0 / 3.0, 1.0 - (2.0 * jnp.minimum(gain, 1.0) - 1.0) ** 3)
        factor = jnp.where(state.fresh, 1.0, chosen(shrink, state.growth))
        damping = jnp.maximum(_LEAST, state.damping * factor)
        step, promised, decrement = _step(at, damping, self.longest)
        y = chosen(state.trial, y)
        # a start that does not run gives nothing to go by, and ends the search
        decrement = jnp.where(state.fresh & ~finite, jnp.nan, decrement)
        growth = chosen(2.0, 2.0 * state.growth)
        return y, _State(jnp.asarray(False), at, y + step, promised, damping, growth, decrement), None

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """At the optimum; or stuck, where no step however short is better."""
        hopeless, stuck = jnp.isnan(state.decrement), state.damping > _MOST
        result = optx.RESULTS.where(stuck, optx.RESULTS.nonlinear_divergence, optx.RESULTS.successful)
        done = (state.decrement <= self.tolerance) | stuck | hopeless
        return done, optx.RESULTS.where(hopeless, optx.RESULTS.nonfinite, result)

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: _State, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The point itself."""
        return y, aux, {}


@sequential_vmap
def _eigh(matrix: Float[Array, "d d"]) -> tuple[Float[Array, " d"], Float[Array, "d d"]]:
    """Eigenvalues and vectors, of a batch one after the other.

    jaxlib 0.10 gives each worker of XLA's pool a part of a batch and waits on one of them for the others: two programs
    at a time, a thread for each core, then wait for each other without end.
    """
    return tuple(jnp.linalg.eigh(matrix))


def _step(at: Expansion, damping: Array, longest: float) -> tuple[Array, Array, Array]:
    """The step, what its quadratic model promises to gain, and what the full step would."""
    diagonal = jnp.abs(jnp.diag(at.hessian))
    size = jnp.where(diagonal > 0.0, jnp.sqrt(diagonal), 1.0)
    values, vectors = _eigh(at.hessian / jnp.outer(size, size))
    gradient = vectors.T @ (at.gradient / size)
    move = -gradient / (jnp.abs(values) + damping)
    move = move * jnp.minimum(1.0, longest / jnp.max(jnp.abs(vectors @ move / size)))
    promised = -jnp.sum(move * (gradient + 0.5 * jnp.abs(values) * move))
    told = jnp.abs(values) > _FLAT * jnp.max(jnp.abs(values), initial=0.0)
    full = 0.5 * jnp.sum(jnp.where(told, gradient**2 / jnp.where(told, jnp.abs(values), 1.0), 0.0))
    # where the curvature is not that of a minimum there is more to gain than a full step tells
    return vectors @ move / size, promised, jnp.where(jnp.any(values < -1e-6), jnp.inf, full)
