r"""Which physics was left out: scan, refit the strongest, weigh them against each other, accept, scan again.

A refitted explanation e with k_e parameters has quasi-likelihood weight
$\exp[-\tfrac12(\chi^2_e/\kappa + k_e\ln N)]$: the Bayesian information criterion, with χ² divided by the inflation κ that
coloured residuals cause (Burnham and Anderson 2002, §2.5). Weights of all forms of one effect add up.
"""

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ..effects import AbstractEffect, admissible, number_fields, with_numbers
from ..estimate import Fit, evaluate, search
from .columns import Trajectory
from .diagnosis import Candidate
from .scan import ABSORBED, Score, plausible, scan

SIGNIFICANCE = 0.01
MOST_EFFECTS = 3
_REFITS = 4
_CONTENDER = 0.6
_CERTAIN = 0.9
_POSSIBLE = 0.02

Progress = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Explanation:
    """A refitted candidate: its search result, cost, and weight among those refitted beside it."""

    score: Score
    found: tuple
    cost: float
    admissible: bool

    @property
    def effect(self) -> AbstractEffect:
        """The effect with its fitted numbers."""
        return self.found[0].effects[-1]


@dataclasses.dataclass(frozen=True)
class Step:
    """One effect accepted: the fit with it, the probability of its name, and the refitted rivals with theirs."""

    fit: Fit
    label: str
    probability: float
    rivals: list[tuple[AbstractEffect, float]]


@dataclasses.dataclass(frozen=True)
class Naming:
    """The effects accepted one after the other, the first scan for the record, and the p-value of what is left."""

    steps: list[Step]
    candidates: list[Candidate]
    first_p: float
    last_p: float


def name(baseline: Fit, vocabulary: Callable[[Fit], Sequence[AbstractEffect]], progress: Progress) -> Naming:
    """Forward selection from `baseline` over `vocabulary`, until nothing significant and admissible is left."""
    fit, steps, table, first_p, last_p = baseline, [], [], 1.0, 1.0
    while True:
        progress(f"scanning the vocabulary ({len(steps)} effects so far)")
        present = {effect.label for effect in fit.vehicle.effects}
        tried = [c for c in vocabulary(fit) if c.label not in present]
        path = Trajectory.of(fit)
        scores = scan(fit, tried, path)
        last_p = min((score.p_value for score in scores), default=1.0)
        refitted = _refit(fit, path, scores, progress) if len(steps) < MOST_EFFECTS else []
        if not table:
            first_p, table = last_p, _table(scores, refitted)
        step = _accept(fit, refitted, len(tried), progress)
        if step is None:
            return Naming(steps, table, first_p, last_p)
        steps.append(step)
        fit = step.fit


def contenders(scores: Sequence[Score]) -> list[Score]:
    """The candidates worth a refit: significant, of admissible sign, the best of their label, near enough to the best."""
    best: dict[str, Score] = {}
    for score in scores:
        if score.admissible and score.p_value < SIGNIFICANCE and score.effect.label not in best:
            best[score.effect.label] = score
    ranked = list(best.values())[: 2 * _REFITS]
    if not ranked:
        return []
    near = [score for score in ranked if score.statistic > _CONTENDER * ranked[0].statistic]
    return near[:_REFITS]


def _refit(fit: Fit, path: Trajectory, scores: Sequence[Score], progress: Progress) -> list[Explanation]:
    """The contenders joined to the model and fitted, two at a time since compiling leaves the other core idle."""
    chosen = contenders(scores)
    if chosen:
        progress(f"refitting {', '.join(score.effect.label for score in chosen)}")
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda score: refit(fit, path, score), chosen))


def refit(fit: Fit, path: Trajectory, score: Score) -> Explanation:
    """All coefficients fitted again with the candidate in the model, from its predicted size or a tenth of it."""
    tries = []
    for share in (1.0, 0.1):
        numbers = {f.name: getattr(score.effect, f.name) for f in number_fields(score.effect)}
        scaled = {k: v * share if _linear(score.effect, k) else v for k, v in numbers.items()}
        vehicle = fit.vehicle.with_effect(with_numbers(score.effect, scaled))
        found = search(vehicle, fit.runs, sigma=fit.sigma, start=fit.start)
        tries.append((float(found[3]), found))
        if np.isfinite(tries[-1][0]) and tries[-1][0] < float(fit.cost):
            break
    cost, found = min(tries, key=lambda item: item[0] if np.isfinite(item[0]) else np.inf)
    effect = found[0].effects[-1]
    values = {f.name: float(getattr(effect, f.name)) for f in number_fields(effect)}
    right = bool(np.isfinite(cost)) and admissible(effect, values) and _alive(effect, values)
    right = right and plausible(effect, path, fit)
    return Explanation(score, found, cost if np.isfinite(cost) else np.inf, right)


def _linear(effect: AbstractEffect, field: str) -> bool:
    return next(f for f in number_fields(effect) if f.name == field).metadata["role"] == "amplitude"


def _alive(effect: AbstractEffect, values: dict[str, float]) -> bool:
    """Whether a shape such as a lag stayed away from the bound at which the effect vanishes."""
    return all(values[f.name] > 1e-6 for f in number_fields(effect) if f.metadata["role"] == "shape")


def _accept(fit: Fit, refitted: list[Explanation], tried: int, progress: Progress) -> Step | None:
    """The most probable admissible explanation as a step, if its gain is significant for all tried."""
    usable = [e for e in refitted if e.admissible and e.cost < float(fit.cost)]
    if not usable:
        return None
    weights = _weights(fit, usable)
    by_name: dict[str, float] = {}
    for explanation, weight in zip(usable, weights, strict=True):
        by_name[explanation.effect.name] = by_name.get(explanation.effect.name, 0.0) + weight
    best = max(zip(usable, weights, strict=True), key=lambda pair: (by_name[pair[0].effect.name], pair[1]))[0]
    gain = 2.0 * (float(fit.cost) - best.cost) / best.score.inflation
    if gain < 2.0 * np.log(tried / SIGNIFICANCE):
        return None
    progress(f"fitting with {best.effect.label}")
    vehicle, start, sigma, cost, steps, result = best.found
    if any(output.sigma is None for output in vehicle.layout.outputs):
        # noise that the file leaves open was the baseline's misfit until now
        vehicle, start, sigma, cost, steps, result = search(vehicle, fit.runs, start=start)
    improved = evaluate(vehicle, fit.runs, start, sigma, cost=cost, steps=steps, result=result)
    rivals: dict[str, tuple[AbstractEffect, float]] = {}
    for explanation in usable:
        kind = explanation.effect.name
        if kind != best.effect.name and kind not in rivals and by_name[kind] > _POSSIBLE:
            rivals[kind] = (explanation.effect, by_name[kind])
    ranked = sorted(rivals.values(), key=lambda rival: -rival[1])
    return Step(improved, best.effect.label, by_name[best.effect.name], ranked)


def _weights(fit: Fit, usable: list[Explanation]) -> list[float]:
    """Posterior weights of refitted explanations, equal before the data."""
    least = min(usable, key=lambda explanation: explanation.cost)
    samples = float(np.sum(np.asarray(fit.runs.mask)))
    size = np.array([len(number_fields(e.effect)) for e in usable])
    log = -np.array([e.cost for e in usable]) / least.score.inflation - 0.5 * size * np.log(samples)
    weights = np.exp(log - log.max())
    return (weights / weights.sum()).tolist()


def certain(step: Step) -> bool:
    """Whether one name stands clear of its rivals."""
    return step.probability >= _CERTAIN


def _table(scores: Sequence[Score], refitted: list[Explanation]) -> list[Candidate]:
    """The scan as lines for the report: the best form of every label."""
    outcome = {}
    for explanation in refitted:
        drop = explanation.score.effect.label
        outcome[drop] = "refitted" if explanation.admissible else "refitted, then of inadmissible sign"
    lines: dict[str, Candidate] = {}
    for score in scores:
        effect = score.effect
        symbols = effect.symbols()
        said = outcome.get(effect.label, _outcome(score))
        predicted = {symbols[f.name]: float(getattr(effect, f.name)) for f in number_fields(effect)}
        line = Candidate(
            effect.name, effect.label, score.statistic, score.degrees, score.p_value, predicted, score.kept, said
        )
        key = f"{effect.label} {sorted(symbols.values())}"
        lines.setdefault(key, line)
    return list(lines.values())


def _outcome(score: Score) -> str:
    if score.kept < ABSORBED:
        return "absorbed by the coefficients"
    if score.p_value >= SIGNIFICANCE:
        return "not significant"
    return "weaker than the best" if score.admissible else "of inadmissible sign"

