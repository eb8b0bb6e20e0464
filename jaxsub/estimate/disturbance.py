r"""The disturbance of largest restricted likelihood, by scoring with the average information.

With V the covariance of the residual e, P what $V^{-1}$ leaves once the columns are fitted and $V_i$ the derivative of
V by a parameter, the Hessian of minus the log restricted likelihood is $\tfrac12\mathrm{tr}\,PV_iPV_j$ averaged over
recordings. $\tfrac12e^TPV_iPV_jPe$ has that average too and needs no trace (Gilmour, Thompson and Cullis 1995,
Biometrics 51): a filter whitens the columns $V_iPe$ beside the others. Pe is the likelihood's own gradient by the
residual and $V_iPe$ a pass back and one forth, so a step costs less than two gradients, and ten of them lead where a
quasi-Newton search needs a hundred.
"""

import dataclasses
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..arrays import Values, namespace, quietly
from ..likelihood import Averages, Columns, Disturbance, System, by_share, covariance_derivatives, restricted, shares
from ..likelihood.disturbance import steps
from ..likelihood.innovation_products import Begun, Steps, innovation_products, products_adjoint, products_and_begun
from ..programs import compiled
from .damped import Damped, State
from .problem import Expansion

# more than any search takes: what ends one is that nothing is left to gain
_STEPS = 50
# a gain of log likelihood that nothing depends on
_ENOUGH = 0.1
# damping that the search begins with: far from the optimum the average information is not its curvature
_DAMPED = 1.0
# standard deviations of weak priors on the logarithms of q, τ and κ: without them an absent force has no optimum
_LOOSE = (5.0, 1.5, 2.0)
# times the longest run, of a time constant: what changes more slowly is constant in a run, and would hide every effect
# that is; and how wide the edge is, of the logarithm
_SLOWEST, _EDGE = 0.5, 0.1
# of those logarithms: beyond, curvature says nothing
_FARTHEST = 2.0
# columns are padded to a multiple of this many, so that models of several sizes share a program
_SIDE_BY_SIDE = 16


class _Prior(NamedTuple):
    """Of the columns (q, q) products; of the logarithms (d,) centres, standard deviations and what they stay below."""

    products: Float[Values, "q q"]
    centre: Float[Values, " d"]
    spread: Float[Values, " d"]
    slowest: Float[Values, " d"]


@quietly
def estimate_disturbance(
    system: System,
    columns: Columns,
    prior: Float[Values, "p1 p1"],
    start: Disturbance,
    *averages: Averages,
    share: float = 0.0,
) -> Disturbance:
    """The disturbance of largest restricted likelihood, or a better one than `start` where that is far from it.

    `system` is the model of the runs, linearised. The first of the `columns` is the residual; `prior` as for
    `restricted`. `averages` of the same columns, of runs too long to be filtered sample by sample, are fitted beside
    them. Priors hold it loosely to the `start`, and its time constants below half the longest run. The search ends
    where less is left to gain than a `share` of what was gained, which serves one of several in alternation. Not to be
    called in `jit`.
    """
    known = len(prior)
    whole = -(-known // _SIDE_BY_SIDE) * _SIDE_BY_SIDE
    xp = namespace(prior)
    filled = xp.pad(prior, (0, whole - known)) + xp.diag(np.repeat([0.0, 1.0], [known, whole - known]))
    # samples are means of one each
    parts = [Averages(system, columns, np.ones(()), np.ones(())), *averages]
    parts = [dataclasses.replace(part, columns=part.columns.padded(whole)) for part in parts]
    longest = max(float(np.max(np.sum(np.asarray(part.system.intervals), axis=-1))) for part in parts)
    each = lambda *values: np.repeat(values, [start.force.size, start.time.size, start.noise.size])
    given = _Prior(filled, _logarithms(start), each(*_LOOSE), each(np.inf, np.log(_SLOWEST * longest), np.inf))
    return _split(_search(parts, given, share), start.force.size)


def _search(parts: Sequence[Averages], prior: _Prior, share: float) -> Array:
    """The logarithms where scoring from the priors' centre ends."""
    solver = Damped(_expand, _ENOUGH, longest=_FARTHEST, share=np.asarray(share), first=_DAMPED)
    y = jax.device_put(np.asarray(prior.centre))
    state = solver.begin(y, Expansion(*jax.device_put([np.zeros(shape) for shape in ((), y.shape, 2 * y.shape)])))
    for _ in range(_STEPS):
        y, state, done = _step(solver, y, state, _expand((parts, prior), state.trial))
        if done:
            break
    return y


@compiled
def _step(solver: Damped, y: Array, state: State, new: Expansion) -> tuple[Array, State, Array]:
    y, state = solver.follow(y, None, state, new)
    return y, state, solver.terminate(None, y, None, {}, state, frozenset())[0]


def _expand(given: tuple[Sequence[Averages], _Prior], y: Array) -> Expansion:
    """The cost to second order, with the average information for its curvature: sums over shares of the runs."""
    parts, prior = given
    forth = [_forth_by_share(part, y) for part in parts]
    grams, log_determinants, _ = zip(*itertools.chain(*forth), strict=True)
    gram, log_determinant = np.sum(grams, axis=0), np.asarray(np.sum(log_determinants))
    cost, slope = _cost(y, prior, gram, log_determinant)
    back = [_back_by_share(part, y, found, slope) for part, found in zip(parts, forth, strict=True)]
    gradient, gram = (np.sum(each, axis=0) for each in zip(*itertools.chain(*back), strict=True))
    return _expanded(y, prior, cost, gradient, gram)


def _forth_by_share(part: Averages, y: Array) -> list[tuple[np.ndarray, np.ndarray, Begun]]:
    def of(some: slice) -> tuple[np.ndarray, np.ndarray, Begun]:
        gram, log_determinant, begun = _forth(y, part.share(some))
        return np.asarray(gram), np.asarray(log_determinant), begun

    return by_share(of, *part.columns.shown.shape[:2])


def _back_by_share(
    part: Averages, y: Array, forth: Sequence[tuple[np.ndarray, np.ndarray, Begun]], slope: Array
) -> list[tuple[np.ndarray, ...]]:
    every = shares(*part.columns.shown.shape[:2])
    begun = {some.start: one[2] for some, one in zip(every, forth, strict=True)}

    def of(some: slice) -> tuple[np.ndarray, ...]:
        return tuple(map(np.asarray, _back(y, part.share(some), begun[some.start], slope)))

    return by_share(of, *part.columns.shown.shape[:2])


def _logarithms(disturbance: Disturbance) -> Values:
    xp = namespace(*jax.tree.leaves(disturbance))
    return xp.log(xp.concatenate([disturbance.force, disturbance.time, disturbance.noise]))


def _split(y: Array, n: int) -> Disturbance:
    return Disturbance(*jnp.split(jnp.exp(y), [n, 2 * n]))


def _at(y: Array, part: Averages) -> Disturbance:
    """The disturbance between the samples of a part."""
    return part.resampled(_split(y, part.system.G.shape[3] // 2))


@compiled
def _forth(y: Array, part: Averages) -> tuple[Array, Array, Begun]:
    """Products of the whitened columns of a share, half the log-determinant, and what the adjoint needs of them."""
    (gram, log_determinant), begun = products_and_begun(*steps(_at(y, part), part.system, part.columns))
    return gram, log_determinant, begun


@compiled
def _back(y: Array, part: Averages, begun: Begun, slope: Float[Array, "q q"]) -> tuple[Array, Float[Array, "e e"]]:
    """A share's part of the gradient by y, and products of its columns with $V_iPe$ beside them.

    `slope` is the cost's derivative by the products of all shares.
    """

    def posed(y: Array, residual: Array) -> tuple[Steps, Array]:
        shown = jnp.asarray(part.columns.shown).at[..., 0].set(residual)
        return steps(_at(y, part), part.system, Columns(shown, part.columns.forcing))

    (at, _), pull = jax.vjp(posed, y, jnp.asarray(part.columns.shown)[..., 0])
    gradient, error = pull(products_adjoint(at, begun, slope, jnp.ones(())))
    more = _derivatives(y, part, error)
    return gradient, innovation_products(*steps(_at(y, part), part.system, part.columns + more))[0]


def _derivatives(y: Array, part: Averages, error: Array) -> Columns:
    """The columns $V_iPe$, of Pe the `error`."""
    own = lambda y: _logarithms(_at(y, part))
    by = covariance_derivatives(_at(y, part), part.system, error) @ jax.jacfwd(own)(y)
    forcing = part.columns.forcing
    return Columns(by, None if forcing is None else jnp.zeros((*forcing.shape[:-1], y.size), y.dtype))


def _unlikely(y: Array, prior: _Prior) -> tuple[Array, Array]:
    """What the priors cost, and the diagonal of its curvature."""
    over = jnp.maximum(y - prior.slowest, 0.0) / _EDGE
    away = (y - prior.centre) / prior.spread
    return 0.5 * jnp.sum(away**2 + over**2), jnp.asarray(prior.spread) ** -2.0 + (over > 0.0) * _EDGE**-2.0


@compiled
def _cost(y: Array, prior: _Prior, gram: Values, log_determinant: Values) -> tuple[Array, Float[Array, "q q"]]:
    """The cost by the sums over all shares, and its derivative by the products."""
    of = lambda gram: restricted(gram + prior.products, jnp.asarray(log_determinant))
    cost, slope = jax.value_and_grad(of)(jnp.asarray(gram))
    return cost + _unlikely(y, prior)[0], slope


@compiled
def _expanded(y: Array, prior: _Prior, cost: Array, gradient: Values, gram: Float[Values, "e e"]) -> Expansion:
    """The cost to second order, by the sums over shares of `_back`."""
    known = len(prior.products)
    gram = gram + jax.scipy.linalg.block_diag(prior.products, jnp.zeros((y.size, y.size), y.dtype))
    fitted, across, own = gram[1:known, 1:known], gram[1:known, known:], gram[known:, known:]
    information = 0.5 * (own - across.T @ jnp.linalg.solve(fitted, across))
    slope = jax.grad(lambda y: _unlikely(y, prior)[0])(y)
    return Expansion(cost, gradient + slope, information + jnp.diag(_unlikely(y, prior)[1]))
