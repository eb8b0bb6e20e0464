r"""Which physics was left out: scan, refit the strongest, weigh them against each other, accept, scan again.

A refitted explanation e with k_e parameters has quasi-likelihood weight
$\exp[-\tfrac12(\chi^2_e/\kappa + k_e\ln N)]$: the Bayesian information criterion, with χ² divided by the inflation κ
that coloured residuals cause (Burnham and Anderson 2002, §2.5). Weights of all forms of one effect add up.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ..effects import AbstractEffect, numbers
from ..estimate import Fit, evaluate, fit, search
from ..results import RESULTS
from ..vehicle import AbstractVehicle
from .columns import Trajectory
from .diagnosis import Candidate
from .refit import SIGNIFICANCE, Explanation, Progress, refit_all
from .scan import ABSORBED, Score, scan

MOST_EFFECTS = 3
_CERTAIN = 0.9
_POSSIBLE = 0.02
_GROSS = 5.0
_PIECES = 8


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


def name(
    baseline: Fit, start: AbstractVehicle, vocabulary: Callable[[Fit], Sequence[AbstractEffect]], progress: Progress
) -> Naming:
    """Forward selection from `baseline` over `vocabulary`, until nothing significant and admissible is left.

    `start` is the vehicle that the baseline was fitted from.
    """
    best, steps, table, first_p, last_p = baseline, [], [], 1.0, 1.0
    while True:
        progress(f"scanning the vocabulary ({len(steps)} effects so far)")
        present = {effect.label for effect in best.vehicle.effects}
        tried = [c for c in vocabulary(best) if c.label not in present]
        view = best if steps else viewpoint(baseline, start)
        path = Trajectory.of(view)
        scores = scan(view, tried, path)
        last_p = min((score.p_value for score in scores), default=1.0)
        refitted = refit_all(best, view, path, scores, progress) if len(steps) < MOST_EFFECTS else []
        if not table:
            first_p, table = last_p, _table(scores, refitted)
        step = _accept(best, refitted, len(tried), progress)
        if step is None:
            return Naming(steps, table, first_p, last_p)
        steps.append(step)
        best = step.fit


def viewpoint(baseline: Fit, start: AbstractVehicle) -> Fit:
    """The fit that the first scan looks from: the baseline, or where it misses grossly, a fit to short pieces.

    Coefficients that had to make up for a large missing force over a whole run are far from the truth, and so is
    everything linearised about them. Over short pieces, each with its own initial state, the missing force has no time
    to drive the model away.
    """
    given = [output.sigma is not None for output in baseline.vehicle.layout.outputs]
    worst = max((rms for rms, known in zip(baseline.rms.values(), given, strict=True) if known), default=0.0)
    if worst < _GROSS and not bool(baseline.result == RESULTS.max_steps_reached):
        return baseline
    return fit(start, baseline.runs.segments(_PIECES), sigma=baseline.sigma)


def _accept(before: Fit, refitted: list[Explanation], tried: int, progress: Progress) -> Step | None:
    """The most probable admissible explanation as a step, if its gain is significant for all tried."""
    usable = [e for e in refitted if e.admissible and e.cost < float(before.cost)]
    if not usable:
        return None
    weights = _weights(before, usable)
    by_name: dict[str, float] = {}
    for explanation, weight in zip(usable, weights, strict=True):
        by_name[explanation.effect.name] = by_name.get(explanation.effect.name, 0.0) + weight
    best = max(zip(usable, weights, strict=True), key=lambda pair: (by_name[pair[0].effect.name], pair[1]))[0]
    gain = 2.0 * (float(before.cost) - best.cost) / noise_inflation(before, best)
    if gain < 2.0 * np.log(tried / SIGNIFICANCE):
        return None
    progress(f"fitting with {best.effect.label}")
    vehicle, start, sigma, cost, steps, result = best.found
    if any(output.sigma is None for output in vehicle.layout.outputs):
        # noise that the file leaves open was the baseline's misfit until now
        vehicle, start, sigma, cost, steps, result = search(vehicle, before.runs, start=start)
    improved = evaluate(vehicle, before.runs, start, sigma, cost=cost, steps=steps, result=result)
    rivals: dict[str, tuple[AbstractEffect, float]] = {}
    for explanation in usable:
        kind = explanation.effect.name
        if kind != best.effect.name and kind not in rivals and by_name[kind] > _POSSIBLE:
            rivals[kind] = (explanation.effect, by_name[kind])
    ranked = sorted(rivals.values(), key=lambda rival: -rival[1])
    return Step(improved, best.effect.label, by_name[best.effect.name], ranked)


def _weights(before: Fit, usable: list[Explanation]) -> list[float]:
    """Posterior weights of refitted explanations, equal before the data."""
    least = min(usable, key=lambda explanation: explanation.cost)
    samples = float(np.sum(np.asarray(before.runs.mask)))
    size = np.array([len(numbers(e.effect)) for e in usable])
    log = -np.array([e.cost for e in usable]) / noise_inflation(before, least) - 0.5 * size * np.log(samples)
    weights = np.exp(log - log.max())
    return (weights / weights.sum()).tolist()


def noise_inflation(before: Fit, explanation: Explanation) -> float:
    """By how much χ² overstates the evidence: 1 where the refit reaches the stated noise, else as its score has it."""
    samples = float(np.sum(np.asarray(before.runs.mask)))
    stated = all(output.sigma is not None for output in before.vehicle.layout.outputs)
    at_floor = 2.0 * explanation.cost < samples + 5.0 * np.sqrt(2.0 * samples)
    return 1.0 if stated and at_floor else explanation.score.inflation


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
        predicted = {symbols[field]: value for field, value in numbers(effect).items()}
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
