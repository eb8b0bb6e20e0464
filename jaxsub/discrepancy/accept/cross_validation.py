r"""How well a model predicts each block of the training runs from the other blocks, and whether another does better.

Accepting an effect needs no run outside the training runs. With $H = \sum_b H_b$ the products of a model's residual and
of its derivatives J by the free numbers over blocks b of the runs, a block is predicted at two horizons:

- one step ahead, $\ln p(y_b | y_{-b}) = \ln Z(H) - \ln Z(H - H_b) - \ln|L_b|$ from whitened innovations, with
  $\ln Z = -\tfrac12(r^Tr - b^TA^{-1}b + \ln|A|)$ the integral over all free numbers and $L_b$ the innovations' factors;
- the whole run, $-\tfrac12\|e_b - J_b\hat\delta_{-b}\|^2$ from simulation errors over σ, with $\hat\delta_{-b}$ the
  least-squares change of the free numbers without the block. A run's initial state is fitted to all of the run, but a
  run's deviation of a number that differs by run is predicted as the free numbers are.

Where neither of two models is better the mean of their differences over n blocks is zero, and Student's t of it has
n - 1 degrees of freedom, but for the differences' skewness γ: a force that acts now and then tells in few blocks, and
much. So it is freed of that by $T = t + \frac{k}{3}t^2 + \frac{k^2}{27}t^3 + \frac{k}{6}$, $k = \gamma/\sqrt n$.
Sources: Stone (1974), J. R. Stat. Soc. B 36 (cross-validation); Künsch (1989), Ann. Statist. 17 (blocks of what is
correlated); Hall (1992), J. R. Stat. Soc. B 54 (removal of skewness).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy import special

from ...arrays import quietly
from ...estimate import Problem, Solution
from ...programs import on_cores
from .. import settings
from ..linearise.products import conditional
from ..linearise.view import Parts, View


class Predicted(NamedTuple):
    """Log predictive densities of blocks of the training runs, each given the others, up to a common constant.

    **Fields**

    - `one_step`: (m,) of innovations. `simulation`: (l,) of simulation errors. Minus infinity where a model diverges.
    """

    one_step: Float[np.ndarray, " m"]
    simulation: Float[np.ndarray, " l"]


class Gain(NamedTuple):
    """By how much one model's log predictive density exceeds another's in total, and two one-sided p-values.

    `better` is how probable so large a gain is where neither model predicts better, `worse` so large a loss.
    """

    total: float
    better: float
    worse: float


class Comparison(NamedTuple):
    """Whether a model with more in it predicts the training runs better, by horizon.

    **Fields**

    - `one_step`, `simulation`: the gain at each horizon. `ratio`: of squared simulation errors, after to before.
    - `admissible`: whether physics admits the numbers of the fit and each is significant.
    """

    one_step: Gain
    simulation: Gain
    ratio: float
    admissible: bool

    @property
    def unlikelier(self) -> bool:
        """Whether it is clearly less probable one step ahead, significantly by blocks or not."""
        return self.one_step.total < -settings.CLEAR_LOG_BAYES

    @property
    def accepted(self) -> bool:
        """Whether it is better at one horizon and worse at none, with admissible numbers.

        One step ahead a clear loss is enough to be worse: these densities are of a noise model that was estimated.
        Squared simulation errors are no density where the vehicle is disturbed.
        """
        horizons = (self.one_step, self.simulation)
        better, worse = (min(getattr(gain, side) for gain in horizons) for side in ("better", "worse"))
        return self.admissible and better < settings.SIGNIFICANCE and not (self.unlikelier or worse < settings.LEVEL)


def compare(before: Predicted, after: Predicted, admissible: bool = True) -> Comparison:
    """What a model `after` gains over one `before` that has less in it."""
    squares = lambda one: -2.0 * float(np.sum(one.simulation))
    ratio = squares(after) / max(squares(before), 1e-300) if np.isfinite(squares(before)) else 0.0
    one_step, simulation = (gain(b, a) for b, a in zip(before, after, strict=True))
    return Comparison(one_step, simulation, ratio, admissible)


def gain(before: Float[np.ndarray, " n"], after: Float[np.ndarray, " n"]) -> Gain:
    """The total of block-wise differences, and how probable it is where their mean is zero, by t without skewness.

    A block that no number describes in one model alone decides; one that is none in both says nothing.
    """
    lost, found = (np.any(~np.isfinite(one)) for one in (after, before))
    if lost or found:
        sign = float(found) - float(lost)
        return Gain(sign * np.inf if sign else 0.0, 0.0 if sign > 0.0 else 1.0, 0.0 if sign < 0.0 else 1.0)
    difference = after - before
    n = len(difference)
    total = float(np.sum(difference))
    if n < 2 or total == 0.0:
        return Gain(total, 1.0, 1.0)
    t = total / max(float(np.std(difference, ddof=1)) * np.sqrt(n), 1e-300)
    about = difference - total / n
    k = float(np.mean(about**3) / max(float(np.mean(about**2)) ** 1.5, 1e-300)) / np.sqrt(n)
    t += k / 3.0 * t**2 + k**2 / 27.0 * t**3 + k / 6.0
    return Gain(total, float(special.stdtr(n - 1, -t)), float(special.stdtr(n - 1, t)))


def one_step_ahead(view: View) -> Float[np.ndarray, " m"]:
    """`Predicted.one_step` of a view's vehicle under the view's disturbance."""
    parts = view.products(view.own, view.disturbance, settings.BLOCKS_ONE_STEP)
    # what lies beyond the end of a short run has nothing
    there = view.measured_by_part(settings.BLOCKS_ONE_STEP) > 0
    parts = Parts(*(own[there] for own in parts))
    gram = parts.products.sum(axis=0) + np.asarray(view.prior)
    if not np.all(np.isfinite(gram)):
        return np.full(len(gram), -np.inf)
    return conditional(gram, parts)


@quietly
def simulated(fit: Solution, blocks: int | None = None, *, known_start: bool = False) -> Float[np.ndarray, " l"]:
    """`Predicted.simulation` of a fit, in `blocks` a run, else `BLOCKS`; initial states may be `known_start`."""
    products = _simulation_products(fit, blocks or settings.BLOCKS)
    nowhere = np.full(products.shape[0] * products.shape[1], -np.inf)
    if not np.all(np.isfinite(products)):
        return nowhere
    problem, free = fit.problem, len(fit.names)
    start_std = np.zeros_like(problem.start_std) if known_start else np.asarray(problem.start_std)
    scale = np.concatenate([np.ones(1 + free), start_std])
    # runs' deviations come before the other initial states
    states, deviations = fit.vehicle.layout.states, fit.vehicle.layout.deviations
    varying = [i for i, name in enumerate(states) if name in deviations]
    others = [i for i in range(len(states)) if i not in varying]
    order = [*range(1 + free), *(1 + free + i for i in (*varying, *others))]
    products = (products * scale[:, None] * scale)[..., order, :][..., order]
    known = 1 + free + len(varying)
    own = slice(known, None)
    # each run's initial state is optimal, and follows the other numbers by Y
    whole = products.sum(axis=1)
    try:
        Y = np.linalg.solve(whole[:, own, own] + np.eye(len(others)), whole[:, own, :known])
    except np.linalg.LinAlgError:
        # products so large that adding one changes none of them are of a model that nearly diverges
        return nowhere
    Y[..., 0] = 0.0
    follow = np.concatenate([np.broadcast_to(np.eye(known), (len(Y), known, known)), -Y], axis=1)
    reduced = np.einsum("rqa,rbqs,rsc->rbac", follow, products, follow)
    away = np.where(start_std > 0.0, np.asarray(fit.start - problem.guess), 0.0)
    moved = away / np.where(start_std > 0.0, start_std, 1.0)
    each = reduced.sum(axis=1) + np.swapaxes(Y, 1, 2) @ Y + _deviation_priors(moved[:, varying], known)
    shared = [_without_last(run, len(varying)) for run in each]
    total = np.sum(shared, axis=0)
    total[1:, 1:] += np.diag(np.asarray(problem.prior_std, float) ** -2.0)
    values = _prior_pull(problem)
    total[0, 1:] += values
    total[1:, 0] += values
    densities = []
    for run, few, cut in zip(each, shared, reduced, strict=True):
        rest = run + np.pad(total - few, (0, len(varying)))
        densities += [-0.5 * _left(rest - block, block) for block in cut]
    return np.array(densities)


def _deviation_priors(moved: Float[np.ndarray, "r v"], known: int) -> Float[np.ndarray, "r q q"]:
    """Products of the priors of runs' deviations, which `moved` by so many standard deviations, the last columns."""
    v = moved.shape[1]
    found = np.zeros((len(moved), known, known))
    found[:, known - v :, known - v :] = np.eye(v)
    found[:, 0, known - v :] = found[:, known - v :, 0] = -moved
    return found


def _without_last(gram: Float[np.ndarray, "q q"], count: int) -> Float[np.ndarray, "m m"]:
    """Products of a residual and columns less what the last `count` columns take up."""
    at = len(gram) - count
    return gram[:at, :at] - gram[:at, at:] @ np.linalg.solve(gram[at:, at:], gram[at:, :at])


def _prior_pull(problem: Problem) -> Float[np.ndarray, " p"]:
    """(p,) products of the free numbers' priors with how far the numbers are below the priors' means."""
    values = problem.vehicle.values()
    at = np.array([float(values[row.name]) for row in problem.vehicle.layout.free])
    return (np.asarray(problem.prior_mean) - at) * np.asarray(problem.prior_std, float) ** -2.0


def _left(others: Float[np.ndarray, "q q"], block: Float[np.ndarray, "q q"]) -> float:
    """The squares that a block has at the numbers of the `others`."""
    size = np.sqrt(np.maximum(np.diag(others)[1:], 1e-300))
    unit = others[1:, 1:] / size[:, None] / size
    # sums of products that are floats, as of a model that nearly diverges, need be none
    if not (np.all(np.isfinite(unit)) and np.all(np.isfinite(others[1:, 0]))):
        return np.inf
    step = np.linalg.lstsq(unit, others[1:, 0] / size, rcond=1e-12)[0] / size
    at = np.concatenate([[1.0], -step])
    return float(at @ block @ at)


def _simulation_products(fit: Solution, blocks: int) -> Float[np.ndarray, "r b q q"]:
    """Products by block of simulation errors over σ and their derivatives by free numbers and the initial state."""

    def of(number: int) -> np.ndarray:
        runs, model = fit.model.share(number)
        weight = (np.asarray(runs.mask) / np.asarray(fit.sigma))[..., None]
        columns = np.concatenate([np.asarray(a) for a in (model.error[..., None], model.theta, model.start)], axis=-1)
        samples = 1 + np.asarray(runs.live).sum(axis=1)
        every = zip(columns * weight, samples, strict=True)
        return np.stack([_by_block(run[:count], blocks) for run, count in every])

    parts = on_cores(of, [(number,) for number in range(len(fit.model.shares))])
    return np.concatenate(parts)[: len(fit.start)]


def _by_block(columns: Float[np.ndarray, "k c q"], blocks: int) -> Float[np.ndarray, "b q q"]:
    flat = [part.reshape(-1, part.shape[-1]) for part in np.array_split(columns, blocks)]
    return np.stack([part.T @ part for part in flat])
