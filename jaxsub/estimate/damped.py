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
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from ..arrays import Values
from .coordinates import Expansion
from .curvature import over_unit_diagonal

_FIRST, _LEAST, _MOST = 1e-3, 1e-10, 1e12

# from y, where a step leads as bounds allow, and how much of it
Along = Callable[[Array, Array], tuple[Array, Array]]


class State(eqx.Module):
    """Where the search is, what it knows there, and what it tries next."""

    fresh: Bool[Array, ""]
    at: Expansion
    trial: Float[Array, " d"]
    promised: Float[Array, ""]
    damping: Float[Array, ""]
    growth: Float[Array, ""]
    gained: Float[Array, ""]
    decrement: Float[Array, ""]


class Damped(optx.AbstractMinimiser):
    r"""Minimises what `expand(args, y)` gives to second order; the function itself is not called.

    Ends where the full step promises a gain below `tolerance`, or below a `share` of what was gained so far, by as much
    as the last step kept of its promise:
    $\tfrac12 g^TH^{-1}g$ is half the squared distance to the optimum in standard errors, so 1e-5 stops within 0.005 of
    one, whatever the units. A trial that is not finite is refused, so only a start that does not run ends as
    `nonfinite`; where no step however short is better the search ends as `nonlinear_divergence`. An entry that presses
    on a bound, with less to gain on the way there than `tolerance`, stays where it is until it is pulled back; what a
    bound stops short of its step is held there, and the others' steps are for that.
    """

    expand: Callable[[Any, Array], Expansion] = eqx.field(static=True)
    tolerance: float = eqx.field(static=True)
    # of what was gained so far: to gain less is not worth a step, where the search is one of several in alternation
    share: Float[Values, ""] | float = 0.0
    # the damping that it begins with, larger where curvature is that of an average
    first: float = eqx.field(static=True, default=_FIRST)
    # largest change of an entry in one step
    longest: float = eqx.field(static=True, default=float("inf"))
    # of `args`: where from y a step leads, and how much of it, if there are bounds; else all of it, straight on
    within: Callable[[Any], Along | None] = eqx.field(static=True, default=lambda args: None)
    # what optimistix asks every solver for and this one has no use of
    rtol: ClassVar[float] = 0.0
    atol: ClassVar[float] = 0.0
    norm: ClassVar[Callable] = staticmethod(optx.two_norm)

    def init(self, fn: Any, y: Array, args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any) -> State:
        """Nothing is known yet; the start itself is tried first."""
        return self.begin(y, eqx.filter_eval_shape(self.expand, args, y))

    def begin(self, y: Array, like: Expansion) -> State:
        """As `init`, where expansions have the shapes of `like`."""
        # by NumPy, for which no program has to be made
        at = jax.tree.map(lambda part: np.zeros(part.shape, part.dtype), like)
        numbers = [np.asarray(number, y.dtype) for number in (1.0, self.first, 2.0, 0.0, np.inf)]
        fresh, at, *rest = jax.device_put((np.asarray(True), at, *numbers))
        return State(fresh, at, y, *rest)

    def step(self, fn: Any, y: Array, args: Any, options: Any, state: State, tags: Any) -> tuple[Array, State, None]:
        """Evaluate the trial, move there if it is better, and choose the next."""
        return *self.follow(y, args, state, self.expand(args, state.trial)), None

    def follow(self, y: Array, args: Any, state: State, new: Expansion) -> tuple[Array, State]:
        """The step, where the trial's expansion is `new`."""
        gain = (state.at.cost - new.cost) / state.promised
        finite = jnp.all(jnp.stack([jnp.all(jnp.isfinite(part)) for part in jax.tree.leaves(new)]))
        # what is stopped by bounds may promise nothing at all, and then is shortened
        good = finite & (state.fresh | ((gain > 0.0) & (state.promised > 0.0)))
        chosen = lambda a, b: jnp.where(good, a, b)
        at = jax.tree.map(chosen, new, state.at)
        # of a start that does not run nothing else is known
        cost = jnp.where(state.fresh, new.cost, at.cost)
        at = eqx.tree_at(lambda expansion: expansion.cost, at, cost)
        shrink = jnp.maximum(1.0 / 3.0, 1.0 - (2.0 * jnp.minimum(gain, 1.0) - 1.0) ** 3)
        factor = jnp.where(state.fresh, 1.0, chosen(shrink, state.growth))
        damping = jnp.maximum(_LEAST, state.damping * factor)
        y = chosen(state.trial, y)
        trial, promised, decrement = self._next(args, y, at, damping)
        # where curvature is of an average, or not that of the way there, steps keep a part of what they promise
        decrement = decrement * jnp.where(good & ~state.fresh, jnp.minimum(gain, 1.0), 1.0)
        # a start that does not run gives nothing to go by, and ends the search
        decrement = jnp.where(state.fresh & ~finite, jnp.nan, decrement)
        growth = chosen(2.0, 2.0 * state.growth)
        gained = state.gained + jnp.where(good & ~state.fresh, state.at.cost - new.cost, 0.0)
        return y, State(jnp.asarray(False), at, trial, promised, damping, growth, gained, decrement)

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: State, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """At the optimum; or stuck, where no step however short is better."""
        hopeless, stuck = jnp.isnan(state.decrement), state.damping > _MOST
        result = optx.RESULTS.where(stuck, optx.RESULTS.nonlinear_divergence, optx.RESULTS.successful)
        done = (state.decrement <= jnp.maximum(self.tolerance, self.share * state.gained)) | stuck | hopeless
        return done, optx.RESULTS.where(hopeless, optx.RESULTS.nonfinite, result)

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: State, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The point itself."""
        return y, aux, {}

    def _next(self, args: Any, y: Array, at: Expansion, damping: Array) -> tuple[Array, Array, Array]:
        """What to try next, what its quadratic model promises to gain, and what the full step would."""
        curvature, size = over_unit_diagonal(at.curvature)
        gradient, along = at.gradient / size, self.within(args)
        if along is not None:
            room = room_downhill(along, y, gradient) * size
            pressed = (room * jnp.abs(gradient) < self.tolerance) & (room < jnp.sqrt(self.tolerance))
            curvature, gradient = curvature.without(pressed), jnp.where(pressed, 0.0, gradient)
        move = -curvature.solve(gradient, damping)
        move = move * jnp.minimum(1.0, self.longest / jnp.max(jnp.abs(move / size)))
        trial = y + move / size
        if along is not None:
            part = along(y, move / size)[1]
            held = part != move / size
            there = jnp.where(held, part * size, 0.0)
            pull = jnp.where(held, 0.0, gradient + curvature.times(there))
            move = there - curvature.without(held).solve(pull, damping)
            trial, part = along(y, move / size)
            move = part * size
        promised = -jnp.sum(move * (gradient + 0.5 * curvature.times(move)))
        return trial, promised, curvature.gain(gradient)


def room_downhill(along: Along, y: Array, gradient: Array) -> Array:
    """How far each entry may step against its gradient, as bounds allow."""
    return jnp.abs(along(y, jnp.where(gradient > 0.0, -jnp.inf, jnp.inf))[1])
