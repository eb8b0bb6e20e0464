r"""The disturbance of largest restricted likelihood, by scoring with the average information.

With V the covariance of the residual e, P what $V^{-1}$ leaves once the columns are fitted and $V_i$ the derivative of
V by a parameter, the Hessian of minus the log restricted likelihood is $\tfrac12\mathrm{tr}\,PV_iPV_j$ averaged over
recordings. $\tfrac12e^TPV_iPV_jPe$ has that average too and needs no trace (Gilmour, Thompson and Cullis 1995,
Biometrics 51): a filter whitens the columns $V_iPe$ beside the others. Pe is the likelihood's own gradient by the
residual and $V_iPe$ a pass back and one forth, so a step costs less than two gradients, and ten of them lead where a
quasi-Newton search needs a hundred.
"""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..arrays import Values, namespace, quietly
from ..likelihood import Averages, Columns, Disturbance, System, covariance_derivatives, restricted, total_products
from ..programs import compiled
from .damped import Damped
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


class _Given(NamedTuple):
    parts: tuple[Averages, ...]
    prior: Array
    centre: Values


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
    """
    known = len(prior)
    whole = -(-known // _SIDE_BY_SIDE) * _SIDE_BY_SIDE
    xp = namespace(prior)
    filled = xp.pad(prior, (0, whole - known)) + xp.diag(np.repeat([0.0, 1.0], [known, whole - known]))
    # samples are means of one each
    one = xp.ones(())
    parts = [dataclasses.replace(part, columns=part.columns.padded(whole)) for part in averages]
    given = _Given((Averages(system, columns.padded(whole), one, one), *parts), filled, _logarithms(start))
    return _search(given, start, xp.asarray(share))


@compiled
def _search(given: _Given, begin: Disturbance, share: Values) -> Disturbance:
    """Where scoring from `begin` ends."""
    solver = Damped(_expand, _ENOUGH, longest=_FARTHEST, share=share, first=_DAMPED)
    end = optx.minimise(_cost, solver, jnp.asarray(_logarithms(begin)), given, max_steps=_STEPS, throw=False)
    return _parts(given, end.value)


def _logarithms(disturbance: Disturbance) -> Values:
    xp = namespace(*jax.tree.leaves(disturbance))
    return xp.log(xp.concatenate([disturbance.force, disturbance.time, disturbance.noise]))


def _parts(given: _Given, y: Array) -> Disturbance:
    n = given.parts[0].system.G.shape[3] // 2
    return Disturbance(*jnp.split(jnp.exp(y), [n, 2 * n]))


def _unlikely(y: Array, given: _Given) -> tuple[Array, Array]:
    """What the priors cost, and the diagonal of its curvature."""
    system = given.parts[0].system
    n, c = system.G.shape[3] // 2, system.C.shape[2]
    each = lambda *values: jnp.repeat(jnp.asarray(values), jnp.asarray([n, n, c]), total_repeat_length=2 * n + c)
    longest = jnp.max(jnp.stack([jnp.max(jnp.sum(part.system.intervals, axis=-1)) for part in given.parts]))
    over = jnp.maximum(y - each(jnp.inf, jnp.log(_SLOWEST * longest), jnp.inf), 0.0) / _EDGE
    away = (y - given.centre) / each(*_LOOSE)
    return 0.5 * jnp.sum(away**2 + over**2), each(*_LOOSE) ** -2.0 + (over > 0.0) * _EDGE**-2.0


@compiled
def _cost(y: Array, given: _Given) -> Array:
    return restricted(*_products(y, given)) + _unlikely(y, given)[0]


def _products(y: Array, given: _Given) -> tuple[Array, Array]:
    """Products of the whitened columns of all parts, the priors' included, and half the log-determinant."""
    disturbance = _parts(given, y)
    found = [total_products(part.resampled(disturbance), part.system, part.columns) for part in given.parts]
    grams, spreads = zip(*found, strict=True)
    return sum(grams, given.prior), sum(spreads, jnp.zeros(()))


@compiled
def _expand(given: _Given, y: Array) -> Expansion:
    """The cost to second order, with the average information for its curvature."""

    def of(y: Array, residuals: list[Array]) -> Array:
        return _cost(y, given._replace(parts=tuple(map(_with_residual, given.parts, residuals))))

    residuals = [jnp.asarray(part.columns.shown)[..., 0] for part in given.parts]
    cost, (gradient, errors) = jax.value_and_grad(of, argnums=(0, 1))(y, residuals)
    parts = tuple(_with_derivatives(given, y, part, error) for part, error in zip(given.parts, errors, strict=True))
    bordered = jax.scipy.linalg.block_diag(given.prior, jnp.zeros((y.size, y.size), y.dtype))
    gram, _ = _products(y, given._replace(parts=parts, prior=bordered))
    known = len(given.prior)
    fitted, across, own = gram[1:known, 1:known], gram[1:known, known:], gram[known:, known:]
    information = 0.5 * (own - across.T @ jnp.linalg.solve(fitted, across))
    return Expansion(cost, gradient, information + jnp.diag(_unlikely(y, given)[1]))


def _with_residual(part: Averages, residual: Array) -> Averages:
    shown = jnp.asarray(part.columns.shown).at[..., 0].set(residual)
    return dataclasses.replace(part, columns=Columns(shown, part.columns.forcing))


def _with_derivatives(given: _Given, y: Array, part: Averages, error: Array) -> Averages:
    """With columns $V_iPe$ beside the others, of Pe the `error`."""
    own = lambda y: _logarithms(part.resampled(_parts(given, y)))
    by = covariance_derivatives(part.resampled(_parts(given, y)), part.system, error) @ jax.jacfwd(own)(y)
    forcing = part.columns.forcing
    unforced = None if forcing is None else jnp.zeros((*forcing.shape[:-1], y.size), y.dtype)
    return dataclasses.replace(part, columns=part.columns + Columns(by, unforced))
