r"""Forward selection with backward elimination by log evidence, and posterior probabilities of effects and rivals.

Nothing is refitted for a selection: about the filtered trajectory the innovations are close to linear in coefficients,
amplitudes and small changes of lags and the like, so the evidence of a set of effects is a function of its block of one
matrix of products. The posterior probability of an effect is its evidence over that of all its alternatives, the other
selected effects held. A priori every name is equally probable, and within a name every form.
"""

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Bool
from scipy import special

from ...effects import AbstractEffect, numbers
from .. import settings
from ..linearise.products import Products
from ..records.diagnosis import Candidate
from ..records.progress import Progress
from .selector import Scan, Selector


@dataclasses.dataclass(frozen=True)
class Named:
    """A selected effect.

    **Fields**

    - `number`: of the candidate; `effect`: with its predicted parameters; `probability`: posterior, of its name.
    - `rivals`: with their posterior probabilities. `collinear`: numbers of rivals to be fitted, those
      nearly collinear with it or more probable.
    """

    number: int
    effect: AbstractEffect
    probability: float
    rivals: list[tuple[AbstractEffect, float]]
    collinear: list[int]


@dataclasses.dataclass(frozen=True)
class Naming:
    """The result of a selection.

    **Fields**

    - `named`: with posterior probabilities, in the order of selection.
    - `products`: under the disturbance that is left. `columns`: of the selected effects. `value`: their log evidence.
    - `first`: the scan before any selection; `candidates`: its lines for the report.
    - `first_p`: family-wise p-value of the largest score before any selection.
    """

    named: list[Named]
    products: Products
    columns: list[int]
    value: float
    first: Scan
    candidates: list[Candidate]
    first_p: float


def select(selector: Selector, progress: Progress) -> tuple[list[int], list[Scan], list[float]]:
    """The selected candidates, the scans before each selection and at the end, and the p-value of each best.

    A candidate that does not improve the prediction of parts of the recordings by the others is passed over: a flexible
    effect fits any misfit, but not the same in every part.
    """
    chosen: list[int] = []
    scans, p_values = [], []
    if not selector.candidates:
        return chosen, [selector.scan(chosen)], [1.0]
    while True:
        progress(f"weighing the vocabulary ({len(chosen)} effects so far)")
        scan = _settled(selector, chosen)
        scans.append(scan)
        best = int(np.argmax(scan.value))
        gain = scan.value[best] - selector.value(chosen)
        p_values.append(selector.p_value(best, scan) if np.isfinite(gain) else 1.0)
        if not gain > 0.0 or p_values[-1] >= settings.SIGNIFICANCE or len(chosen) == settings.MOST_EFFECTS:
            return chosen, scans, p_values
        if not selector.predicts(chosen, best):
            selector.usable[best] = False
            scans.pop()
            p_values.pop()
            continue
        chosen = _without_idle(selector, [*chosen, best])


def _settled(selector: Selector, chosen: list[int]) -> Scan:
    """The scan with the disturbances estimated for the leading candidates, each beside `chosen`.

    Where none gains, also for candidates that the disturbance may have absorbed.
    """
    scan = _led(selector, chosen)
    if np.max(scan.value) > selector.value(chosen):
        return scan
    for index in selector.absorbed(chosen):
        selector.estimate([*chosen, index])
    return selector.scan(chosen)


def _led(selector: Selector, chosen: list[int]) -> Scan:
    """The scan with the disturbance estimated for the best candidate, or for the first few that were."""
    for _ in range(1 + settings.ALTERNATIVES):
        scan = selector.scan(chosen)
        best = int(np.argmax(scan.value))
        gain = scan.value[best] - selector.value(chosen)
        if not np.isfinite(gain) or gain < -settings.CLEAR_LOG_BAYES:
            return scan
        if tuple(sorted([*chosen, best])) in selector.estimated:
            return scan
        selector.estimate([*chosen, best])
    return selector.scan(chosen)


def _without_idle(selector: Selector, chosen: list[int]) -> list[int]:
    """Backward elimination: `chosen` less those without which the log evidence is larger."""
    while len(chosen) > 1:
        whole = selector.value(chosen)
        less = [selector.value([c for c in chosen if c != i]) for i in chosen]
        worst = int(np.argmax(less))
        if less[worst] < whole:
            return chosen
        chosen = [c for c in chosen if c != chosen[worst]]
    return chosen


def name(selector: Selector, progress: Progress) -> Naming:
    """The selected effects with their posterior probabilities."""
    chosen, scans, _ = select(selector, progress)
    value, products = selector.evidence.best(selector.columns(chosen))
    named = with_probabilities(selector, chosen)
    lines = table(selector, scans[0])
    first_p = selector.smallest_p_value(scans[0])
    return Naming(named, products, selector.columns(chosen), value, scans[0], lines, first_p)


def with_probabilities(selector: Selector, chosen: Sequence[int], refused: Collection[int] = ()) -> list[Named]:
    """Each of some candidates with its posterior probability and rivals, the others of them in the model."""
    return [named_on(selector, [i for i in chosen if i != index], index, refused) for index in chosen]


def named_on(selector: Selector, others: Sequence[int], index: int, refused: Collection[int] = ()) -> Named:
    """A candidate on top of `others` with its posterior probability and rivals, less those `refused`."""
    scan = selector.scan(others)
    out = {selector.candidates[i].name for i in refused} - {selector.candidates[index].name}
    may = selector.alternatives_to(others, index) & np.array([effect.name not in out for effect in selector.candidates])
    if index not in selector.by_simulation:
        may &= ~significant_beside(selector, others, index, scan)
    may[index] = True
    log = np.where(may, scan.value, -np.inf)
    weights = special.softmax(log)
    own, label = selector.candidates[index].name, selector.candidates[index].label
    by_name: dict[str, float] = {}
    # of its own effect the best in every equation: in another it is no rival, but may be collinear
    best: dict[str, int] = {}
    for i, (effect, weight) in enumerate(zip(selector.candidates, weights, strict=True)):
        by_name[effect.name] = by_name.get(effect.name, 0.0) + float(weight)
        key = effect.label if effect.name == own else effect.name
        if log[i] > log[best.setdefault(key, i)]:
            best[key] = i
    rivals = [(scan.effects[best[n]], p) for n, p in by_name.items() if n != own and p > 0.0]
    # coefficients absorb the linearisation error as they absorb the effect, but not as exactly
    off = min(settings.MAJORITY, settings.SCORE_ERROR / np.sqrt(max(selector.kept[index], 1e-12)))
    near = [j for key, j in best.items() if key != label and np.isfinite(log[j])]
    place = scan.effects[index].where
    # where a motion is no larger than its noise, the filtered trajectory favours the square of a rate over its cube
    least = lambda j: settings.MAJORITY if scan.effects[j].where == place else 1.0 - off
    # simulation may select what is less probable by innovations than a rival, which then is fitted first
    alike = lambda j: scan.statistic[j] > least(j) * scan.statistic[index] or log[j] > log[index]
    near = [j for j in near if alike(j)]
    collinear = sorted(near, key=lambda j: -log[j])[: settings.ALTERNATIVES]
    rivals = sorted(rivals, key=lambda rival: -rival[1])
    return Named(index, scan.effects[index], min(1.0, by_name[own]), rivals, collinear)


def significant_beside(selector: Selector, others: Sequence[int], index: int, scan: Scan) -> Bool[np.ndarray, " m"]:
    """(m,) whether each candidate of a `scan` on top of `others` is significant still with `index` in the model.

    Then it is missing too, and no rival.
    """
    beside = selector.scan([*others, index])
    significant = np.array([selector.p_value(i, beside) < settings.SIGNIFICANCE for i in range(len(beside.value))])
    return significant & (beside.statistic > settings.MAJORITY * scan.statistic)


def refitted(named: Named, values: Sequence[tuple[AbstractEffect, float]]) -> Named:
    """A selected effect with posterior probabilities by the log evidence of fits; those not fitted keep theirs."""
    own = [v for effect, v in values if effect.name == named.effect.name]
    if not own:
        return named
    weights = special.softmax([v for _, v in values])
    names = {effect.name for effect, _ in values}
    share = named.probability + sum(p for rival, p in named.rivals if rival.name in names)
    found = [(effect, share * float(w)) for (effect, _), w in zip(values, weights, strict=True)]
    others = [pair for pair in named.rivals if pair[0].name not in names]
    others += [pair for pair in found if pair[0].name != named.effect.name]
    probability = min(1.0, sum(p for effect, p in found if effect.name == named.effect.name))
    return dataclasses.replace(named, probability=probability, rivals=sorted(others, key=lambda pair: -pair[1]))


def table(selector: Selector, scan: Scan) -> list[Candidate]:
    """The first scan as lines for the report: the best form of every label, the strongest first."""
    lines: dict[str, Candidate] = {}
    for i in np.argsort(-scan.statistic):
        effect, degrees, statistic = scan.effects[i], int(selector.degrees[i]), float(scan.statistic[i])
        symbols = effect.symbols()
        predicted = {symbols[field]: value for field, value in numbers(effect).items()}
        p_value = selector.p_value(int(i), scan)
        kept = float(selector.kept[i]) if selector.usable[i] else 0.0
        outcome = _outcome(bool(selector.usable[i]), bool(scan.right[i]), p_value)
        units = {symbols[field]: unit for field, unit in effect.units().items()}
        line = Candidate(effect.name, effect.label, statistic, degrees, p_value, predicted, kept, outcome, units)
        lines.setdefault(f"{effect.label} {sorted(symbols.values())}", line)
    return list(lines.values())


def _outcome(usable: bool, right: bool, p_value: float) -> str:
    if not usable:
        return "absorbed by the coefficients"
    if p_value >= settings.SIGNIFICANCE:
        return "not significant"
    return "significant" if right else "of inadmissible sign"
