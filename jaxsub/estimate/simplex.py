"""The simplex search of the manoeuvring paper, section 4.2, one sample of the cost at a time."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

# what the next sample of the cost is for
_CORNER, _CENTROID, _REFLECT, _EXPAND, _CONTRACT = range(5)


class _Simplex(eqx.Module):
    """The search between two samples of the cost.

    **Fields**

    - `corners`, `costs`: of the simplex; the cost of a corner not sampled yet, or not finite, is infinite.
    - `pending`: corners not sampled yet.
    - `phase`: what `trial`, the point to be sampled next, is for.
    - `reflected`, `reflected_cost`: the reflected corner and its cost.
    - `evaluations`: samples taken. `done`: the stopping rule holds. `lost`: no corner has a finite cost.
    """

    corners: Float[Array, "m1 m"]
    costs: Float[Array, " m1"]
    pending: Bool[Array, " m1"]
    phase: Int[Array, ""]
    trial: Float[Array, " m"]
    reflected: Float[Array, " m"]
    reflected_cost: Float[Array, ""]
    evaluations: Int[Array, ""]
    done: Bool[Array, ""]
    lost: Bool[Array, ""]


class NelderMead(optx.AbstractMinimiser):
    r"""Nelder and Mead's simplex search as section 4.2 of the paper lists it, of J over vectors $\theta$ of m entries.

    With $\theta_h, \theta_l$ the corners of highest and lowest J and $\theta_b$ the centroid of all but $\theta_h$:
    reflect $\theta_r = 2\theta_b - \theta_h$. Where $J_r < J_l$, expand $\theta_e = 2\theta_r - \theta_b$ and keep it
    if $J_e < J_l$, else $\theta_r$. Where $J_r \ge J_i$ for all $i \ne h$, contract to
    $\theta_c = (\theta_r + \theta_b)/2$ if $J_r < J_h$, else $(\theta_h + \theta_b)/2$, and keep it if $J_c < J_h$,
    else shrink $\theta_i = (\theta_i + \theta_l)/2$. Otherwise keep $\theta_r$. Stop and return $\theta_l$ when

    $$\sqrt{\tfrac{1}{m+1}\sum_i (J_i - J(\theta_b))^2} \le \epsilon.$$

    The paper does not say how the simplex begins: here with $\theta_0$ and, along each coordinate in turn, $\theta_0$ +
    `size`. Of corners of equal cost the first counts, and a cost that is not finite counts as $+\infty$. The rule
    compares costs alone and can hold far from a minimum, where they happen to be alike: look at the gradient.

    A step of the solver, and of `max_steps`, is one sample of J and no more: under `vmap`, where every branch of a
    conditional runs, searches that reflect, contract and shrink at the same time then waste nothing.
    `stats["num_evaluations"]` counts them. A search that finds no finite cost at its first corners ends with
    `RESULTS.nonfinite`.

    **Fields**

    - `tolerance`: $\epsilon$, in the unit of J.
    - `size`: of the first simplex, in the unit of $\theta$.
    """

    tolerance: float
    size: float = 0.1
    # what optimistix asks every solver for and this one has no use of
    rtol: ClassVar[float] = 0.0
    atol: ClassVar[float] = 0.0
    norm: ClassVar[Callable] = staticmethod(optx.rms_norm)

    def init(
        self, fn: Any, y: Float[Array, " m"], args: Any, options: Any, f_struct: Any, aux_struct: Any, tags: Any
    ) -> _Simplex:
        """The first simplex, nothing sampled yet."""
        corners = jnp.concatenate([y[None], y + self.size * jnp.eye(y.size, dtype=y.dtype)])
        infinite = jnp.full(y.size + 1, jnp.inf, f_struct.dtype)
        every, no = jnp.ones(y.size + 1, bool), jnp.array(False)
        return _Simplex(corners, infinite, every, jnp.array(_CORNER), y, y, infinite[0], jnp.array(0), no, no)

    def step(
        self, fn: Any, y: Float[Array, " m"], args: Any, options: Any, state: _Simplex, tags: Any
    ) -> tuple[Array, _Simplex, Any]:
        """Sample the cost once, and find what to sample next."""
        cost, aux = fn(state.trial, args)
        after = _follow(state, jnp.where(jnp.isfinite(cost), cost, jnp.inf), self.tolerance)
        return after.corners[jnp.argmin(after.costs)], after, aux

    def terminate(
        self, fn: Any, y: Array, args: Any, options: Any, state: _Simplex, tags: Any
    ) -> tuple[Bool[Array, ""], optx.RESULTS]:
        """Whether the stopping rule holds, or nothing can be done."""
        result = optx.RESULTS.where(state.lost, optx.RESULTS.nonfinite, optx.RESULTS.successful)
        return state.done | state.lost, result

    def postprocess(
        self, fn: Any, y: Array, aux: Any, args: Any, options: Any, state: _Simplex, tags: Any, result: optx.RESULTS
    ) -> tuple[Array, Any, dict[str, Any]]:
        """The best corner, the auxiliary output there and the number of samples."""
        return y, fn(y, args)[1], {"num_evaluations": state.evaluations}


def _follow(simplex: _Simplex, cost: Float[Array, ""], tolerance: float) -> _Simplex:
    """The search after `cost` was found at its trial point: steps 1 to 8 of the paper."""
    corners, costs, phase = simplex.corners, simplex.costs, simplex.phase
    index = jnp.arange(len(costs))
    high, low = jnp.argmax(costs), jnp.argmin(costs)

    reflecting, expanding, contracting = phase == _REFLECT, phase == _EXPAND, phase == _CONTRACT
    reflected = jnp.where(reflecting, simplex.trial, simplex.reflected)
    reflected_cost = jnp.where(reflecting, cost, simplex.reflected_cost)
    expand = reflecting & (cost < costs[low])
    contract = reflecting & ~expand & jnp.all((cost >= costs) | (index == high))
    shrink = contracting & ~(cost < costs[high])

    fall_back = expanding & ~(cost < costs[low])
    replace = (reflecting & ~expand & ~contract) | expanding | (contracting & ~shrink)
    at = jnp.where(phase == _CORNER, jnp.argmax(simplex.pending), high)
    new = (index == at) & (replace | (phase == _CORNER))
    corners = jnp.where(new[:, None], jnp.where(fall_back, reflected, simplex.trial), corners)
    costs = jnp.where(new, jnp.where(fall_back, reflected_cost, cost), costs)

    shrunk = shrink & (index != low)
    corners = jnp.where(shrunk[:, None], 0.5 * (corners + corners[low]), corners)
    costs = jnp.where(shrunk, jnp.inf, costs)
    pending = jnp.where(shrink, shrunk, simplex.pending & ~new)

    stop = (phase == _CENTROID) & (jnp.sqrt(jnp.mean((costs - cost) ** 2)) <= tolerance)
    following = jnp.where(jnp.any(pending), _CORNER, _CENTROID)
    following = jnp.where(phase == _CENTROID, _REFLECT, following)
    following = jnp.where(expand, _EXPAND, jnp.where(contract, _CONTRACT, following))
    return _Simplex(
        corners,
        costs,
        pending,
        following,
        _trial(corners, costs, pending, following, reflected, reflected_cost),
        reflected,
        reflected_cost,
        simplex.evaluations + 1,
        stop,
        ~jnp.any(pending) & ~jnp.any(jnp.isfinite(costs)),
    )


def _trial(
    corners: Array, costs: Array, pending: Array, phase: Array, reflected: Array, reflected_cost: Array
) -> Float[Array, " m"]:
    """The point that `phase` needs."""
    high = jnp.argmax(costs)
    others = jnp.arange(len(costs)) != high
    centroid = jnp.sum(jnp.where(others[:, None], corners, 0.0), axis=0) / (len(costs) - 1)
    outside = reflected_cost < costs[high]
    points = {
        _CORNER: corners[jnp.argmax(pending)],
        _CENTROID: centroid,
        _REFLECT: 2.0 * centroid - corners[high],
        _EXPAND: 2.0 * reflected - centroid,
        _CONTRACT: 0.5 * (jnp.where(outside, reflected, corners[high]) + centroid),
    }
    return jnp.stack([points[key] for key in range(5)])[phase]
