"""Exact second derivatives, and the paper's own Newton iteration on them."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float


def second_order(fn: Any, y: Float[Array, " m"], args: Any) -> tuple[Array, Array, Array, Any]:
    """`fn`, its gradient (m,), its exact Hessian (m, m) and its auxiliary output at `y`.

    Forward over reverse mode: on the output-error cost of 21 coefficients it takes 0.4 of the time of forward over
    forward and no more memory, for 1.5 times the compilation.
    """

    def gradient(y: Array) -> tuple[Array, tuple[Array, Array, Any]]:
        (value, aux), slope = jax.value_and_grad(fn, has_aux=True)(y, args)
        return slope, (value, slope, aux)

    hessian, (value, slope, aux) = jax.jacfwd(gradient, has_aux=True)(y)
    return value, slope, hessian, aux


class _Iteration(eqx.Module):
    done: Bool[Array, ""]
    lost: Bool[Array, ""]


class NewtonEq10(optx.AbstractMinimiser):
    r"""The paper's modified Newton–Raphson iteration, eq. 10, of J over vectors $\theta$ of m entries.

    $$\mu g + [H + \lambda I]\,\Delta\theta = 0, \quad \lambda = \max_i |g_i|, \quad
    \mu = 0.5 \text{ if } \lambda > 1 \text{ else } 1/(\lambda + 1),$$

    with g the gradient and H the exact Hessian. It has no safeguard: it may climb, end at a saddle point or a maximum,
    or never end, and it depends on the units of J and $\theta$. Where a step is not finite the last $\theta$ is kept
    and the result is `RESULTS.nonfinite`. The paper gives no stopping rule: here a step ends the iteration when
    $|\Delta\theta_i| \le$ `atol` + `rtol` $|\theta_i|$ for all i and $\lambda \le$ `atol` + `rtol` $|J|$: the first
    alone also holds where $\lambda$ is so large that nothing moves. A step of the solver is one evaluation of J, g, H.
    """

    rtol: float
    atol: float
    norm: ClassVar[Callable] = staticmethod(optx.max_norm)

    def init(
        self, fn: Any, y: Float[Array, " m"], args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any
    ) -> _Iteration:
        """Nothing done yet."""
        return _Iteration(jnp.array(False), jnp.array(False))

    def step(
        self, fn: Any, y: Float[Array, " m"], args: Any, options: Any, state: _Iteration, tags: Any
    ) -> tuple[Array, _Iteration, Any]:
        """One step of eq. 10."""
        value, slope, hessian, aux = second_order(fn, y, args)
        damping = jnp.max(jnp.abs(slope))
        share = jnp.where(damping > 1.0, 0.5, 1.0 / (damping + 1.0))
        change = -share * jnp.linalg.solve(hessian + damping * jnp.eye(y.size, dtype=y.dtype), slope)
        lost = ~(jnp.isfinite(value) & jnp.all(jnp.isfinite(y + change)))
        done = self.norm(change / (self.atol + self.rtol * jnp.abs(y + change))) <= 1.0
        done = done & (damping <= self.atol + self.rtol * jnp.abs(value))
        return jnp.where(lost, y, y + change), _Iteration(done, lost), aux

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: _Iteration, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Whether the last step was small, or not finite."""
        result = optx.RESULTS.where(state.lost, optx.RESULTS.nonfinite, optx.RESULTS.successful)
        return state.done | state.lost, result

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: Any, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The last iterate, and the auxiliary output there: that of the last evaluation is of another point."""
        return y, fn(y, args)[1], {}
