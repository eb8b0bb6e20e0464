r"""The disturbance of largest restricted likelihood, by scoring with the average information.

With V the covariance of the residual e, P what $V^{-1}$ leaves once the columns are fitted and $V_i$ the derivative of
V by a parameter, the Hessian of minus the log restricted likelihood is $\tfrac12\mathrm{tr}\,PV_iPV_j$ averaged over
recordings. $\tfrac12e^TPV_iPV_jPe$ has that average too and needs no trace (Gilmour, Thompson and Cullis 1995,
Biometrics 51): a filter whitens the columns $V_iPe$ beside the others. Pe is the likelihood's own gradient by the
residual and $V_iPe$ a pass back and one forth, so a step costs less than two gradients, and ten of them lead where a
quasi-Newton search needs a hundred.
"""

import dataclasses
from collections.abc import Callable, Sequence
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..arrays import Values, namespace, quietly
from ..likelihood import Averages, Columns, Disturbance, System, covariance_derivatives, restricted, shares
from ..likelihood.disturbance import disturbed, steps
from ..likelihood.innovation_products import Begun, Steps, innovation_products, products_adjoint, products_and_begun
from ..programs import compiled
from ..workers import on_workers
from .coordinates import Expansion
from .damped import Damped, State

R = TypeVar("R")
# calls a function with each part of the recordings and with what is given beside it by the part's number
_Over = Callable[[Callable[..., R], Callable[[int], tuple]], list[R]]

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
    """Products of the columns (q, q); the disturbance at the centre; and the logarithm that its times stay below."""

    products: Float[Values, "q q"]
    centre: Disturbance
    slowest: Float[Values, ""]


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
    where less is left to gain than a `share` of what was gained, which serves one of several in alternation.

    Many runs are passed over in shares. Not to be called in `jit`.
    """
    parts, products = _padded(system, columns, prior, averages)
    many = [(part, some) for part in parts for some in shares(*part.columns.shown.shape[:2])]
    if len(many) == len(parts):
        return _searched(parts, products, start, np.asarray(share))

    def over(function: Callable[..., R], beside: Callable[[int], tuple]) -> list[R]:
        own = lambda number, part, some: (function, part.share(some), *beside(number))
        return on_workers(_waited, [partial(own, number, *one) for number, one in enumerate(many)])

    known = _Prior(products, start, _slowest(parts, np))
    y = jax.device_put(np.asarray(_logarithms(start)))
    new = _expand(over, known, y)
    state = _solver(lambda *_: new, share).begin(y, new)
    for _ in range(_STEPS):
        y, state, done = _step(y, state, new, np.asarray(share))
        if done:
            break
        new = _expand(over, known, state.trial)
    return Disturbance(*np.split(np.exp(y), [start.force.size, 2 * start.force.size]))


def _waited(function: Callable[..., R], *given: Any) -> R:
    """A function's answer in NumPy, so that no more parts than cores are in memory."""
    return jax.device_get(function(*given))


def estimate_disturbance_at_once(
    system: System,
    columns: Columns,
    prior: Float[Values, "p1 p1"],
    start: Disturbance,
    *averages: Averages,
) -> Disturbance:
    """`estimate_disturbance` of all runs at once, also in `jit`, in memory that grows with their number.

    Of `system`, `columns`, `prior`, `start` and `averages` as there.
    """
    parts, products = _padded(system, columns, prior, averages)
    return _searched(parts, products, start, np.zeros(()))


def _padded(
    system: System, columns: Columns, prior: Float[Values, "p1 p1"], averages: Sequence[Averages]
) -> tuple[tuple[Averages, ...], Float[Values, "q q"]]:
    """All parts of the recordings and the columns' prior, padded to a width that models of several sizes share."""
    known = len(prior)
    whole = -(-known // _SIDE_BY_SIDE) * _SIDE_BY_SIDE
    xp = namespace(prior)
    filled = xp.pad(prior, (0, whole - known)) + xp.diag(np.repeat([0.0, 1.0], [known, whole - known]))
    # samples are means of one each
    parts = (Averages(system, columns, np.ones(()), np.ones(())), *averages)
    return tuple(dataclasses.replace(part, columns=part.columns.padded(whole)) for part in parts), filled


@compiled
def _searched(parts: tuple[Averages, ...], prior: Values, start: Disturbance, share: Values) -> Disturbance:
    """Where scoring from the priors' centre ends, all of the recordings taken at once."""
    known = _Prior(prior, start, _slowest(parts, jnp))
    every = lambda parts: lambda function, beside: [function(part, *beside(n)) for n, part in enumerate(parts)]
    expand = lambda parts, y: _expand(every(parts), known, y)
    cost = lambda y, parts: expand(parts, y).cost
    y = jnp.asarray(_logarithms(start))
    end = optx.minimise(cost, _solver(expand, share), y, parts, max_steps=_STEPS, throw=False)
    return _split(end.value, start.force.size)


def _solver(expand: Callable[..., Expansion], share: Values | float) -> Damped:
    return Damped(expand, _ENOUGH, longest=_FARTHEST, share=share, first=_DAMPED)


def _slowest(parts: Sequence[Averages], xp: ModuleType) -> Float[Values, ""]:
    durations = [xp.max(xp.sum(xp.asarray(part.system.intervals), axis=-1)) for part in parts]
    return xp.asarray(xp.log(_SLOWEST * xp.max(xp.stack(durations))))


@compiled
def _step(y: Array, state: State, new: Expansion, share: Values) -> tuple[Array, State, Array]:
    """Where the search goes on from the `new` expansion at its trial, and whether it has ended."""
    solver = _solver(lambda *_: new, share)
    y, state, _ = solver.step(None, y, None, {}, state, frozenset())
    return y, state, solver.terminate(None, y, None, {}, state, frozenset())[0]


def _expand(over: _Over, prior: _Prior, y: Array) -> Expansion:
    """The cost to second order, with the average information for its curvature: sums over parts of the recordings."""
    grams, log_determinants, begun = zip(*over(_forth, lambda number: (y,)), strict=True)
    cost, slope = _cost(y, prior, _total(grams), _total(log_determinants))
    back = over(_back, lambda number: (y, begun[number], slope))
    gradient, gram = map(_total, zip(*back, strict=True))
    return _expanded(y, prior, cost, gradient, gram)


def _total(parts: Sequence[Values]) -> Values:
    return namespace(*parts).asarray(sum(parts[1:], start=parts[0]))


def _logarithms(disturbance: Disturbance) -> Values:
    xp = namespace(*jax.tree.leaves(disturbance))
    return xp.log(xp.concatenate([disturbance.force, disturbance.time, disturbance.noise]))


def _split(y: Array, n: int) -> Disturbance:
    return Disturbance(*jnp.split(jnp.exp(y), [n, 2 * n]))


def _at(y: Array, part: Averages) -> Disturbance:
    """The disturbance between the samples of a part."""
    return part.resampled(_split(y, part.system.G.shape[3] // 2))


@compiled
def _forth(part: Averages, y: Array) -> tuple[Array, Array, Begun]:
    """Products of the whitened columns of a share, half the log-determinant, and what the adjoint needs of them."""
    (gram, log_determinant), begun = products_and_begun(*steps(_at(y, part), part.system, part.columns))
    return gram, log_determinant, begun


@compiled
def _back(part: Averages, y: Array, begun: Begun, slope: Float[Array, "q q"]) -> tuple[Array, Float[Array, "e e"]]:
    """A share's part of the gradient by y, and products of its columns with $V_iPe$ beside them.

    `slope` is the cost's derivative by the products of all shares.
    """

    (F, B, noise, _), pull = jax.vjp(lambda y: disturbed(_at(y, part), part.system), y)
    at = Steps(F, B, part.system.C, noise, part.columns.shown, part.columns.forcing)
    *by, error = products_adjoint(at, begun, slope, jnp.ones(()))
    (gradient,) = pull(tuple(by))
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
    sizes = [prior.centre.force.size, prior.centre.time.size, prior.centre.noise.size]
    each = lambda *values: jnp.repeat(jnp.asarray(values), np.asarray(sizes), total_repeat_length=sum(sizes))
    over = jnp.maximum(y - each(jnp.inf, prior.slowest, jnp.inf), 0.0) / _EDGE
    away = (y - _logarithms(prior.centre)) / each(*_LOOSE)
    return 0.5 * jnp.sum(away**2 + over**2), each(*_LOOSE) ** -2.0 + (over > 0.0) * _EDGE**-2.0


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
