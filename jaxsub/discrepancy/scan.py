r"""The score scan: how much of the residual each candidate would explain that the coefficients cannot.

With whitened residuals r, the Jacobian J of the free coefficients and initial states, and a candidate's columns S,
$S_\perp = S - J(J^TJ)^{-1}J^TS$; then $b^TG^{-1}b$ with $b = S_\perp^Tr$, $G = S_\perp^TS_\perp$ is χ² under "nothing
left out", $G^{-1}b$ predicts the amplitudes, and $|S_\perp|^2/|S|^2$ is what the coefficients leave of the trace.
Source: Rao's score test; design.md.
"""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int
from scipy import special

from ..effects import AbstractEffect, AbstractSensor, admissible, amplitudes, with_numbers
from ..estimate import Fit, Problem
from ..likelihood import Linearised
from .columns import Trajectory, candidate_columns, sensor_change

ABSORBED = 1e-5
_BLOCKS = 24


@dataclasses.dataclass(frozen=True)
class Score:
    """One candidate's line of the scan.

    `statistic` is χ² with `degrees` of freedom where residuals are white; `inflation` ≥ 1 is how much larger the
    variance of its score is than whiteness would have it, from sums over blocks of the residual that is left after the
    candidate; `p_value` is of statistic / inflation and corrected for all tried. `effect` carries predicted amplitudes.
    """

    effect: AbstractEffect
    statistic: float
    degrees: int
    inflation: float
    p_value: float
    kept: float
    admissible: bool


def project(fit: Fit, columns: Float[Array, "r k c q"]) -> tuple[Array, Array, Array]:
    """Whitened columns less what coefficients and initial states absorb, their squares before, and the residual."""
    return _project(fit.model, fit.problem, columns)


@eqx.filter_jit
def _project(model: Linearised, problem: Problem, columns: Array) -> tuple[Array, Array, Array]:
    weight = (problem.runs.mask / problem.sigma)[..., None]
    S, theta, start = columns * weight, model.theta * weight, model.start * weight * problem.spread
    residual = model.error / problem.sigma
    before = jnp.sum(S**2, (0, 1, 2))
    own = jnp.einsum("rkcs,rkct->rst", start, start) + jnp.eye(len(problem.spread))

    def off_start(M: Array) -> Array:
        return M - jnp.einsum("rkcs,rsq->rkcq", start, jnp.linalg.solve(own, jnp.einsum("rkcs,rkcq->rsq", start, M)))

    S, theta = off_start(S), off_start(theta)
    size = jnp.sqrt(jnp.maximum(jnp.sum(theta**2, (0, 1, 2)), 1e-300))
    unit = theta / size
    normal = jnp.einsum("rkcp,rkcq->pq", unit, unit) + jnp.diag((problem.prior_std * size) ** -2.0)
    values, vectors = jnp.linalg.eigh(normal)
    inverse = jnp.where(values > 1e-12, 1.0 / jnp.maximum(values, 1e-12), 0.0)
    solved = (vectors * inverse) @ (vectors.T @ jnp.einsum("rkcp,rkcq->pq", unit, S))
    return S - jnp.einsum("rkcp,pq->rkcq", unit, solved), before, residual


@eqx.filter_jit
def block_sums(
    S: Float[Array, "r k c q"], residual: Float[Array, "r k c"], left: Int[Array, " g"], right: Int[Array, " g"]
) -> tuple[Float[Array, "b q"], Float[Array, "b g"]]:
    """Σ S·r of every column and Σ S·S of every pair (left, right) of columns, over each of B blocks of time."""
    runs, samples = S.shape[:2]
    blocks = max(2, _BLOCKS // runs)
    length = -(-samples // blocks)
    filled = [(0, 0), (0, blocks * length - samples)]

    def summed(product: Array) -> Array:
        padded = jnp.pad(product, [*filled, (0, 0)])
        return padded.reshape(runs * blocks, length, -1).sum(1)

    return summed(jnp.einsum("rkcq,rkc->rkq", S, residual)), summed(jnp.sum(S[..., left] * S[..., right], axis=2))


def scan(fit: Fit, candidates: Sequence[AbstractEffect], path: Trajectory) -> list[Score]:
    """A score for every candidate, the largest statistic first."""
    columns, owners = candidate_columns(fit, path, candidates)
    mine = [[j for j, owner in enumerate(owners) if owner == i] for i in range(len(candidates))]
    pairs = [(a, b) for own in mine for a in own for b in own]
    projected, before, residual = project(fit, columns)
    left, right = (jnp.asarray(side) for side in zip(*pairs, strict=True))
    towards, among = (np.asarray(sums) for sums in block_sums(projected, residual, left, right))
    before, first, scores = np.asarray(before), 0, []
    for effect, own in zip(candidates, mine, strict=True):
        q = len(own)
        G = among[:, first : first + q * q].reshape(-1, q, q)
        first += q * q
        score = _score(effect, towards[:, own], G, before[own], len(candidates))
        scores.append(dataclasses.replace(score, admissible=score.admissible and plausible(score.effect, path, fit)))
    return sorted(scores, key=lambda score: -score.statistic)


def _score(effect: AbstractEffect, b: np.ndarray, G: np.ndarray, before: np.ndarray, tried: int) -> Score:
    """The score from sums over blocks: `b` (B, q) of S·r, `G` (B, q, q) of S·S; `before` (q,) unprojected squares."""
    total, after = G.sum(0), np.diag(G.sum(0))
    kept = float(np.min(after / np.maximum(before, 1e-300)))
    if not np.all(np.isfinite(total)) or kept < ABSORBED:
        return Score(effect, 0.0, len(before), 1.0, 1.0, 0.0, True)
    size = np.sqrt(after)
    scaled = np.linalg.lstsq(total / np.outer(size, size), b.sum(0) / size, rcond=1e-10)[0]
    amplitude = scaled / size
    statistic = float(np.dot(amplitude, b.sum(0)))
    blocks = b @ amplitude - np.einsum("bij,i,j->b", G, amplitude, amplitude)
    inflation = score_inflation(blocks, statistic)
    p_value = min(1.0, tried * float(special.chdtrc(len(before), statistic / inflation)))
    names = amplitudes(effect)
    values = dict(zip(names, amplitude.tolist(), strict=True)) if names else {}
    # a lag that wants to be of the other sign shows as a negative share of its own grid value
    right = admissible(effect, values) if names else bool(amplitude[0] > 0.0)
    return Score(with_numbers(effect, values), statistic, len(before), inflation, p_value, kept, right)


def plausible(effect: AbstractEffect, path: Trajectory, fit: Fit) -> bool:
    """Whether a sensor's error is smaller than what the sensor shows: a larger one is no sensor error but a way out."""
    if not isinstance(effect, AbstractSensor):
        return True
    change, shown = sensor_change(fit, path, effect)
    return float(np.ptp(change)) <= float(np.ptp(shown))


def score_inflation(blocks: np.ndarray, white: float) -> float:
    """How many times the variance of a score exceeds its `white` value, from its sums over `blocks` of time.

    An estimate from B blocks scatters by √(2/B); only what exceeds twice that counts, so that white residuals lose
    nothing.
    """
    ratio = float(np.sum(blocks**2)) / max(white, 1e-300)
    return max(1.0, ratio / (1.0 + 2.0 * np.sqrt(2.0 / len(blocks))))
