"""Candidates joined to the model and fitted, so that they compete with all that the coefficients can do."""

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..effects import AbstractEffect, admissible, amplitudes, numbers, with_numbers
from ..estimate import Fit, search
from .columns import Trajectory
from .scan import Score, plausible

Progress = Callable[[str], None]
SIGNIFICANCE = 0.01
_REFITS = 4
_CONTENDER = 0.6


@dataclasses.dataclass(frozen=True)
class Explanation:
    """A refitted candidate: what the search found, at which cost, and whether physics admits it."""

    score: Score
    found: tuple
    cost: float
    admissible: bool

    @property
    def effect(self) -> AbstractEffect:
        """The effect with its fitted numbers."""
        return self.found[0].effects[-1]


def contenders(scores: Sequence[Score]) -> list[Score]:
    """The candidates worth a refit: significant, of admissible sign, best of their label, near enough to the best."""
    best: dict[str, Score] = {}
    for score in scores:
        if score.admissible and score.p_value < SIGNIFICANCE and score.effect.label not in best:
            best[score.effect.label] = score
    ranked = list(best.values())[: 2 * _REFITS]
    if not ranked:
        return []
    near = [score for score in ranked if score.statistic > _CONTENDER * ranked[0].statistic]
    return near[:_REFITS]


def refit_all(fit: Fit, view: Fit, path: Trajectory, scores: Sequence[Score], progress: Progress) -> list[Explanation]:
    """The contenders among `scores`, each in the model, fitted to the runs of `fit` from the coefficients of `view`.

    Two at a time, since compiling leaves the other core idle.
    """
    chosen = contenders(scores)
    if chosen:
        progress(f"refitting {', '.join(score.effect.label for score in chosen)}")
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda score: _refit(fit, view, path, score), chosen))


def _refit(fit: Fit, view: Fit, path: Trajectory, score: Score) -> Explanation:
    """All coefficients fitted again with the candidate in the model, from its predicted size or a tenth of it."""
    tries = []
    for share in (1.0, 0.1):
        linear = amplitudes(score.effect)
        scaled = {field: value * share if field in linear else value for field, value in numbers(score.effect).items()}
        vehicle = view.vehicle.with_effect(with_numbers(score.effect, scaled))
        found = search(vehicle, fit.runs, sigma=fit.sigma, start=fit.start)
        tries.append((float(found[3]), found))
        if np.isfinite(tries[-1][0]) and tries[-1][0] < float(fit.cost):
            break
    cost, found = min(tries, key=lambda item: item[0] if np.isfinite(item[0]) else np.inf)
    effect = found[0].effects[-1]
    right = bool(np.isfinite(cost)) and admissible(effect, numbers(effect)) and _alive(effect)
    right = right and plausible(effect, path, view)
    return Explanation(score, found, cost if np.isfinite(cost) else np.inf, right)


def _alive(effect: AbstractEffect) -> bool:
    """Whether a shape such as a lag stayed away from the bound at which the effect vanishes."""
    linear = amplitudes(effect)
    return all(value > 1e-6 for field, value in numbers(effect).items() if field not in linear)
