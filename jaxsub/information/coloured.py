r"""Standard errors when the residuals are coloured.

The Cramér–Rao bound $D = (S^TR^{-1}S)^{-1}$ takes the residuals for white noise. With residuals of covariance Γ the
estimate that minimised their squares scatters by (Maine and Iliff 1981; Klein and Morelli 2006, ch. 5)

$\mathrm{Cov} = D\,\Big[\sum_{i,j} S_i^T R^{-1}\,\Gamma_{ij}\,R^{-1} S_j\Big]\,D.$

They take $\Gamma_{ij}$ for the autocorrelation $R_{vv}(i-j)$ of the residuals. For a vehicle running free over tens of
seconds it is no function of i - j, since heading and depth integrate, and the fit has removed the slowest part of it:
nominal 95 % intervals then cover about 70 %. Here Γ is that of disturbance forces seen through the linearised model.
Initial states are eliminated; priors count as observations of their own precision.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..arrays import quietly
from ..estimate import Coordinates, Solution
from ..likelihood import Disturbance, Linearised, System, share_of
from ..likelihood.blocks import Watch, nobody
from ..likelihood.disturbance import Adjoint, carried_back, carried_to_start
from ..likelihood.run_shares import Progress
from ..programs import compiled, on_cores
from ..recording.runs import Runs
from .residual_disturbance import Directions, Noise, residual_disturbance, whitened_columns


class Coloured(eqx.Module):
    """The scatter of a fit's coefficients under the disturbance that its residuals show.

    **Fields**

    - `covariance`: (p, p), physical units. `disturbance`: the forces and the noise that explain the residuals.
    - `names`: of the coefficients.
    """

    covariance: Float[Array, "p p"]
    disturbance: Disturbance
    names: tuple[str, ...] = eqx.field(static=True)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors by name, physical units."""
        return dict(zip(self.names, np.sqrt(np.diag(np.asarray(self.covariance))).tolist(), strict=True))


@quietly
def coloured_covariance(fit: Solution, disturbance: Disturbance | None = None, watch: Watch = nobody) -> Coloured:
    """The covariance of the coefficients of `fit` that allows for coloured residuals. NaN where the search failed.

    The `disturbance` is estimated from the residuals where none is given. Coefficients at a bound are held there.
    `watch` is called with the share of both passes over the samples that is done.
    """
    problem, model = fit.problem, fit.model
    held, noise = np.asarray(fit.pressed) != 0.0, Noise.of(problem)
    reduced = _reduced(problem.without_vehicle, problem.values, model.products, held)
    if disturbance is None:
        disturbance = residual_disturbance(problem, model, reduced.directions, lambda share: watch(0.5 * share))
    done = Progress(model.shares, lambda share: watch(0.5 + 0.5 * share))

    def of(some: slice) -> np.ndarray:
        size = some.stop - some.start
        number, gain = some.start // size, share_of(reduced.gain, some)
        adjoint = Adjoint.at_end(size, len(problem.start_std), len(disturbance.force), len(fit.names))
        for index in reversed(range(model.blocks)):
            block = model.block(number, index)
            adjoint = _back(noise, *block, reduced._replace(gain=gain), disturbance, adjoint)
            done.of(some)(1.0 - index / model.blocks)
        return np.asarray(_to_start(disturbance, adjoint))

    carried = np.sum(on_cores(of, [(some,) for some in model.shares]), axis=0)
    return Coloured(jax.device_put(_sandwich(reduced, carried)), disturbance, fit.names)


class _Reduced(NamedTuple):
    """A fit's directions of unit information.

    `gain` (R, s, p) is how initial states follow the coefficients, `pinned` (p, p) the information of priors,
    `directions` those that are identifiable and `unidentifiable` (p, p) the others.
    """

    gain: Array
    pinned: Array
    directions: Directions
    unidentifiable: Array


@compiled
def _reduced(
    space: Coordinates, at: Float[Array, " p"], products: Float[Array, "r q q"], held: Bool[Array, " p"]
) -> _Reduced:
    p = len(held)
    theta = jnp.where(held[:, None] | held, 0.0, products[:, :p, :p])
    mixed = jnp.where(held, 0.0, products[:, p:-1, :p])
    precision = jnp.where(held, 1.0, space.prior_std**-2.0)
    own = products[:, p:-1, p:-1]
    gain = jnp.linalg.solve(own + jnp.eye(own.shape[-1]), mixed)
    # what is left of the columns once the initial states have followed, and what their priors then say
    turned = jnp.swapaxes(gain, 1, 2)
    across = turned @ mixed
    left = theta - across - jnp.swapaxes(across, 1, 2) + turned @ own @ gain
    pinned = jnp.sum(turned @ gain, axis=0) + jnp.diag(precision)
    basis, unidentifiable = _directions(jnp.sum(left, axis=0) + pinned)
    away = jnp.where(held, 0.0, space.prior_mean - at)
    pulled = jnp.column_stack([away, basis])
    prior = pulled.T @ (precision[:, None] * pulled)
    # an unidentifiable direction has an empty column, and must not make the matrix of the others singular
    empty = jnp.all(basis == 0.0, axis=0)
    prior = prior.at[1:, 1:].add(jnp.diag(jnp.where(empty, 1.0, 0.0)))
    return _Reduced(gain, pinned, Directions(held, basis, prior), unidentifiable)


@compiled
def _back(
    noise: Noise,
    runs: Runs,
    model: Linearised,
    reduced: _Reduced,
    disturbance: Disturbance,
    after: Adjoint,
) -> Adjoint:
    """The adjoint recursion of the scores' covariance through one block."""
    theta, start, _ = whitened_columns(noise, runs, model)
    system = System.of(model, runs, noise.sigma, noise.start_std)
    left = jnp.where(reduced.directions.held, 0.0, theta) - start @ reduced.gain[:, None]
    return carried_back(disturbance, system, left, after)


_to_start = compiled(carried_to_start)


def _sandwich(reduced: _Reduced, carried: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """D = basis basisᵀ on either side of the scores' covariance, so that white noise alone gives D back."""
    basis, unidentifiable, pinned = map(np.asarray, (reduced.directions.basis, reduced.unidentifiable, reduced.pinned))
    return basis @ (basis.T @ (carried + pinned) @ basis) @ basis.T + unidentifiable @ unidentifiable.T


def _directions(information: Float[Array, "p p"]) -> tuple[Float[Array, "p p"], Float[Array, "p p"]]:
    """Columns in which the information is the unit matrix, empty where there is none, and the columns left out."""
    size = jnp.sqrt(jnp.diag(information))
    scale = jnp.where(size > 0.0, size, 1.0)
    values, vectors = jnp.linalg.eigh(information / jnp.outer(scale, scale))
    eps = jnp.finfo(values.dtype).eps
    columns = vectors / jnp.sqrt(jnp.maximum(values, 50.0 * eps)) / scale[:, None]
    determined = values > 1e4 * eps
    return jnp.where(determined, columns, 0.0), jnp.where(determined, 0.0, columns)
