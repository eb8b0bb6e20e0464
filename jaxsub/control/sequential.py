r"""Sequential quadratic programming with Gauss-Newton curvature, as a minimiser of optimistix."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from .quadratic import Quadratic, quadratic_minimum

_FIRST, _LEAST, _MOST = 1e-6, 1e-9, 1e9


class _State(eqx.Module):
    """Where the search is, the quadratic program there, and what it tries next."""

    fresh: Bool[Array, ""]
    cost: Float[Array, ""]
    program: Quadratic
    trial: Float[Array, " d"]
    promised: Float[Array, ""]
    gain: Float[Array, ""]
    damping: Float[Array, ""]


class Sequential(optx.AbstractMinimiser):
    r"""Minimises what `expand(args, y)` gives: a cost and the quadratic program of a step from y.

    A step solves the program with H + λ diag(H), λ by how much of its promise it kept (Marquardt 1963). The cost holds
    what yields; what is hard in the program is linear in y, so that every point of a search from one that keeps it
    does. Ends where a step promises less than `tolerance` of 1 + cost, or none however short is better.
    """

    expand: Callable[[Any, Array], tuple[Array, Quadratic]] = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)
    # what optimistix asks every solver for and this one has no use of
    rtol: ClassVar[float] = 0.0
    atol: ClassVar[float] = 0.0
    norm: ClassVar[Callable] = staticmethod(optx.two_norm)

    def init(self, fn: Any, y: Array, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> _State:
        """Nothing is known yet; the start itself is tried first."""
        one = jnp.ones((), y.dtype)
        shapes = jax.eval_shape(lambda: self.expand(args, y))[1]
        program = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
        return _State(jnp.asarray(True), jnp.inf * one, program, y, jnp.inf * one, jnp.inf * one, _FIRST * one)

    def step(self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any) -> tuple[Array, _State, None]:
        """Evaluate the trial, move there if it is better, and choose the next."""
        cost, program = self.expand(args, state.trial)
        kept = (state.cost - cost) / state.gain
        good = jnp.isfinite(cost) & (state.fresh | (kept > 0.0))
        chosen = lambda new, old: jax.tree.map(lambda a, b: jnp.where(good, a, b), new, old)
        eased = jnp.where(kept > 0.25, jnp.where(kept > 0.75, 0.1, 1.0), 10.0)
        damping = jnp.clip(state.damping * jnp.where(state.fresh, 1.0, jnp.where(good, eased, 100.0)), _LEAST, _MOST)
        y, cost, program = chosen(state.trial, y), chosen(cost, state.cost), chosen(program, state.program)
        stiff = eqx.tree_at(lambda p: p.H, program, program.H + damping * jnp.diag(jnp.diag(program.H)))
        move, _ = quadratic_minimum(stiff)
        gain = _penalised(program, jnp.zeros_like(move)) - _penalised(program, move)
        move, gain = jnp.where(jnp.isfinite(gain), move, 0.0), jnp.where(jnp.isfinite(gain), gain, 0.0)
        return y, _State(jnp.asarray(False), cost, program, y + move, gain / (1.0 + cost), gain, damping), None

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: _State, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """At the optimum; or stuck, where no step however short is better."""
        stuck = state.damping >= _MOST
        result = optx.RESULTS.where(stuck, optx.RESULTS.nonlinear_divergence, optx.RESULTS.successful)
        # a start that does not run promises nothing
        result = optx.RESULTS.where(jnp.isfinite(state.cost) | state.fresh, result, optx.RESULTS.nonfinite)
        return ~state.fresh & ((state.promised <= self.tolerance) | stuck | ~jnp.isfinite(state.cost)), result

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: _State, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The point itself."""
        return y, aux, {}


def _penalised(program: Quadratic, d: Float[Array, " d"]) -> Float[Array, ""]:
    """The program's objective without what is hard."""
    past = jnp.maximum(program.G @ d + program.g, 0.0)
    yields = program.w > 0.0
    penalty = jnp.sum(jnp.where(yields, past**2 / jnp.where(yields, program.w, 1.0), 0.0))
    return 0.5 * d @ program.H @ d + program.q @ d + 0.5 * penalty
