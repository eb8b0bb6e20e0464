r"""The disturbance of largest restricted likelihood, by scoring with the average information.

With V the covariance of the residual e, P what $V^{-1}$ leaves once the columns are fitted and $V_i$ the derivative of
V by a parameter, the Hessian of minus the log restricted likelihood is $\tfrac12\mathrm{tr}\,PV_iPV_j$ averaged over
recordings. $\tfrac12e^TPV_iPV_jPe$ has that average too and needs no trace (Gilmour, Thompson and Cullis 1995,
Biometrics 51): a filter whitens the columns $V_iPe$ beside the others. Pe is the likelihood's own gradient by the
residual and $V_iPe$ a pass back and one forth, so a step costs less than two gradients, and ten of them lead where a
quasi-Newton search needs a hundred.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from ..arrays import Values, namespace
from ..likelihood import Columns, Disturbance, System, covariance_derivatives, products, restricted
from .damped import Damped
from .problem import Expansion

_STEPS = 10
# a gain of log likelihood that nothing depends on
_ENOUGH = 0.1
# standard deviations of weak priors on the logarithms of q, τ and κ: without them an absent force has no optimum
_LOOSE = (5.0, 1.5, 2.0)
# times the longest run, of a time constant: what changes more slowly is constant in a run, and would hide every effect
# that is; and how wide the edge is, of the logarithm
_SLOWEST, _EDGE = 0.5, 0.1
# of those logarithms: beyond, curvature says nothing
_FARTHEST = 2.0
# columns are padded to a multiple of this many, so that models of several sizes share a program
_SIDE_BY_SIDE = 16


class _Given(NamedTuple):
    system: System
    columns: Columns
    prior: Array
    centre: Array


def estimate_disturbance(
    system: System,
    columns: Columns,
    prior: Float[Values, "p1 p1"],
    start: Disturbance,
    *,
    steps: int = _STEPS,
    rounds: int = 1,
) -> Disturbance:
    """The disturbance of largest restricted likelihood, or a better one than `start` where that is far from it.

    The first of the `columns` is the residual; `prior` as for `restricted`. Priors hold it loosely to the `start`, and
    its time constants below half the longest run. It takes at most so many `steps`, for which it is compiled, in each
    of so many `rounds`; in `jit` only one.
    """
    known = len(prior)
    whole = -(-known // _SIDE_BY_SIDE) * _SIDE_BY_SIDE
    xp = namespace(prior)
    filled = xp.pad(prior, (0, whole - known)) + xp.diag(np.repeat([0.0, 1.0], [known, whole - known]))
    found, columns = start, columns.padded(whole)
    for left in reversed(range(rounds)):
        found, done = _search(system, columns, filled, start, found, steps)
        if left and bool(done):
            break
    return found


@eqx.filter_jit
def _search(
    system: System, columns: Columns, prior: Array, centre: Disturbance, begin: Disturbance, steps: int
) -> tuple[Disturbance, Bool[Array, ""]]:
    """At most so many `steps` from `begin`, with priors about `centre`, and whether they arrived."""
    given = _Given(system, columns, prior, _logarithms(centre))
    solver = Damped(_expand, _ENOUGH, _FARTHEST)
    end = optx.minimise(_cost, solver, _logarithms(begin), given, max_steps=steps, throw=False)
    return _parts(given, end.value), end.result == optx.RESULTS.successful


def _logarithms(disturbance: Disturbance) -> Array:
    return jnp.log(jnp.concatenate([disturbance.force, disturbance.time, disturbance.noise]))


def _parts(given: _Given, y: Array) -> Disturbance:
    n = given.system.G.shape[3] // 2
    return Disturbance(*jnp.split(jnp.exp(y), [n, 2 * n]))


def _unlikely(y: Array, given: _Given) -> tuple[Array, Array]:
    """What the priors cost, and the diagonal of its curvature."""
    n, c = given.system.G.shape[3] // 2, given.system.C.shape[2]
    each = lambda *values: jnp.repeat(jnp.asarray(values), jnp.asarray([n, n, c]), total_repeat_length=2 * n + c)
    longest = jnp.max(jnp.sum(given.system.intervals, axis=-1))
    over = jnp.maximum(y - each(jnp.inf, jnp.log(_SLOWEST * longest), jnp.inf), 0.0) / _EDGE
    away = (y - given.centre) / each(*_LOOSE)
    return 0.5 * jnp.sum(away**2 + over**2), each(*_LOOSE) ** -2.0 + (over > 0.0) * _EDGE**-2.0


@eqx.filter_jit
def _cost(y: Array, given: _Given) -> Array:
    return restricted(_parts(given, y), given.system, given.columns, given.prior) + _unlikely(y, given)[0]


@eqx.filter_jit
def _expand(given: _Given, y: Array) -> Expansion:
    """The cost to second order, with the average information for its curvature."""
    system, columns, prior = given.system, given.columns, given.prior

    def of(y: Array, residual: Array) -> Array:
        shown = jnp.asarray(columns.shown).at[..., 0].set(residual)
        return _cost(y, given._replace(columns=Columns(shown, columns.forcing)))

    cost, (gradient, error) = jax.value_and_grad(of, argnums=(0, 1))(y, columns.shown[..., 0])
    by = covariance_derivatives(_parts(given, y), system, error)
    unforced = None if columns.forcing is None else jnp.zeros((*columns.forcing.shape[:-1], y.size), y.dtype)
    bordered = jax.scipy.linalg.block_diag(prior, jnp.zeros((y.size, y.size), y.dtype))
    gram, _ = products(_parts(given, y), system, columns + Columns(by, unforced), bordered)
    known = len(prior)
    fitted, across, own = gram[1:known, 1:known], gram[1:known, known:], gram[known:, known:]
    information = 0.5 * (own - across.T @ jnp.linalg.solve(fitted, across))
    return Expansion(cost, gradient, information + jnp.diag(_unlikely(y, given)[1]))
