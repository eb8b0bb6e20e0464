r"""Which physics was left out: forward selection with backward elimination by evidence, and the rivals' probabilities.

Nothing is refitted for a selection: along the motion that took place the recordings are close to linear in the
coefficients, in the amplitudes and in small changes of lags and the like, so a set of effects is judged by its block of
one matrix of products. The probability of an effect is its evidence over that of all that may stand in its place, the
others chosen held; equal before the data for every name, and within a name for every form.
"""

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Bool
from scipy import special

from ..effects import AbstractEffect, numbers
from .diagnosis import Candidate
from .evidence import Products
from .progress import Progress
from .selector import Scan, Selector
from .settings import (
    DISTURBANCE_ESTIMATES,
    ESTIMATED_LOG_BAYES,
    MAJORITY,
    MOST_EFFECTS,
    MOST_SCORE_ERROR,
    RIVAL_PROBABILITY,
    RIVALS_FITTED,
    SCORE_ERROR,
    SIGNIFICANCE,
)


@dataclasses.dataclass(frozen=True)
class Named:
    """An effect chosen.

    **Fields**

    - `number`: of the candidate; `effect`: with its predicted numbers; `probability`: of its name.
    - `rivals`: with their probabilities. `twins`: numbers of rivals to be fitted, which a linear picture
      cannot tell from it or finds more probable.
    """

    number: int
    effect: AbstractEffect
    probability: float
    rivals: list[tuple[AbstractEffect, float]]
    twins: list[int]


@dataclasses.dataclass(frozen=True)
class Naming:
    """What was chosen, and how.

    **Fields**

    - `named`: with probabilities, in the order of choice.
    - `products`: at the disturbance that is left. `columns`: of what was chosen. `value`: its log evidence.
    - `again`: whether a free run asked for the last, so that one should look again with it in the model.
    - `first`: the scan before any choice; `candidates`: its lines for the report.
    - `first_p`: family-wise p-value of the largest score before any choice.
    """

    named: list[Named]
    products: Products
    columns: list[int]
    value: float
    again: bool
    first: Scan
    candidates: list[Candidate]
    first_p: float


def select(selector: Selector, progress: Progress) -> tuple[list[int], list[Scan], list[float]]:
    """Candidates chosen one after the other; the scans before each choice and at the end; the p-values of each best.

    One that does not help to predict a part of the recordings from the others is passed over: a model that is wrong in
    other ways finds in any flexible enough effect something to fit, but not the same thing everywhere. One that a free
    run asks for ends the search: what a model that errs so much says of smaller things is not to be trusted.
    """
    chosen: list[int] = []
    scans, p_values = [], []
    while True:
        progress(f"weighing the vocabulary ({len(chosen)} effects so far)")
        scan = _settled(selector, chosen)
        scans.append(scan)
        best = selector.foremost(chosen, scan)
        gain = scan.value[best] - selector.value(chosen)
        p_values.append(selector.p_value(best, scan) if np.isfinite(gain) else 1.0)
        if not gain > 0.0 or p_values[-1] >= SIGNIFICANCE or len(chosen) == MOST_EFFECTS:
            return chosen, scans, p_values
        if not selector.predicts(chosen, best):
            selector.usable[best] = False
            scans.pop()
            p_values.pop()
            continue
        if best in selector.freely:
            return [*chosen, best], scans, p_values
        chosen = _without_idle(selector, [*chosen, best])


def _settled(selector: Selector, chosen: list[int]) -> Scan:
    """The scan once the leaders' own disturbances are known: what a rival leaves to a disturbance must not count.

    Where none gains, also those of what may be hidden in the disturbance.
    """
    scan = _led(selector, chosen)
    if np.max(scan.value) > selector.value(chosen):
        return scan
    for index in selector.hidden(chosen):
        selector.estimate([*chosen, index])
    return selector.scan(chosen)


def _led(selector: Selector, chosen: list[int]) -> Scan:
    """The scan once the best, or the first few that were, have their own disturbances estimated."""
    for _ in range(DISTURBANCE_ESTIMATES):
        scan = selector.scan(chosen)
        best = int(np.argmax(scan.value))
        if not np.isfinite(scan.value[best]) or scan.value[best] - selector.value(chosen) < -ESTIMATED_LOG_BAYES:
            return scan
        if tuple(sorted([*chosen, best])) in selector.estimated:
            return scan
        selector.estimate([*chosen, best])
    return selector.scan(chosen)


def _without_idle(selector: Selector, chosen: list[int]) -> list[int]:
    """`chosen` less those that the others make idle."""
    while len(chosen) > 1:
        whole = selector.value(chosen)
        less = [selector.value([c for c in chosen if c != i]) for i in chosen]
        worst = int(np.argmax(less))
        if less[worst] < whole:
            return chosen
        chosen = [c for c in chosen if c != chosen[worst]]
    return chosen


def name(selector: Selector, progress: Progress) -> Naming:
    """The effects that the recordings ask for, with probabilities."""
    chosen, scans, _ = select(selector, progress)
    value, products = selector.evidence.best(selector.columns(chosen))
    named = standing(selector, chosen)
    lines = table(selector, scans[0])
    again = any(i in selector.freely for i in chosen)
    first_p = selector.smallest_p_value(scans[0])
    return Naming(named, products, selector.columns(chosen), value, again, scans[0], lines, first_p)


def standing(selector: Selector, chosen: Sequence[int], refused: Collection[int] = ()) -> list[Named]:
    """Each of some candidates with its probability and rivals, the others of them in the model."""
    return [named_on(selector, [i for i in chosen if i != index], index, refused) for index in chosen]


def named_on(selector: Selector, others: Sequence[int], index: int, refused: Collection[int] = ()) -> Named:
    """The probability of a candidate on top of `others`, and of what might stand there and was not `refused`."""
    scan = selector.scan(others)
    out = {selector.candidates[i].name for i in refused} - {selector.candidates[index].name}
    may = selector.stand_in(others, index) & np.array([effect.name not in out for effect in selector.candidates])
    if index not in selector.freely:
        may &= ~asked_still(selector, others, index, scan)
    may[index] = True
    log = np.where(may, scan.value, -np.inf)
    weights = special.softmax(log)
    own, label = selector.candidates[index].name, selector.candidates[index].label
    by_name: dict[str, float] = {}
    # of its own effect the best in every place: elsewhere it is no rival, but may be a twin
    best: dict[str, int] = {}
    for i, (effect, weight) in enumerate(zip(selector.candidates, weights, strict=True)):
        by_name[effect.name] = by_name.get(effect.name, 0.0) + float(weight)
        key = effect.label if effect.name == own else effect.name
        if log[i] > log[best.setdefault(key, i)]:
            best[key] = i
    rivals = [(scan.effects[best[n]], p) for n, p in by_name.items() if n != own and p > RIVAL_PROBABILITY]
    # what coefficients absorb of an effect, they absorb of the picture's errors too, but not as exactly
    off = min(MOST_SCORE_ERROR, SCORE_ERROR / np.sqrt(max(selector.kept[index], 1e-12)))
    near = [j for key, j in best.items() if key != label and np.isfinite(log[j])]
    place = scan.effects[index].where
    # where a motion is no larger than its noise, a picture along it gives the square of a rate too much and its cube
    # too little
    least = lambda j: MAJORITY if scan.effects[j].where == place else 1.0 - off
    # a free run may ask for what is less probable sample by sample than a rival, which then is tried before it
    alike = lambda j: scan.statistic[j] > least(j) * scan.statistic[index] or log[j] > log[index]
    near = [j for j in near if alike(j)]
    twins = sorted(near, key=lambda j: -log[j])[:RIVALS_FITTED]
    return Named(index, scan.effects[index], min(1.0, by_name[own]), sorted(rivals, key=lambda rival: -rival[1]), twins)


def asked_still(selector: Selector, others: Sequence[int], index: int, scan: Scan) -> Bool[np.ndarray, " m"]:
    """(m,) whether each candidate of a `scan` on top of `others` is asked for still with `index` in the model.

    Where many are missing another may do as much and be no rival.
    """
    beside = selector.scan([*others, index])
    asked = np.array([selector.p_value(i, beside) < SIGNIFICANCE for i in range(len(beside.value))])
    return asked & (beside.statistic > MAJORITY * scan.statistic)


def refitted(named: Named, values: Sequence[tuple[AbstractEffect, float]]) -> Named:
    """A chosen effect with the probabilities of it and its twins by the log evidence of fits, others' as they were."""
    own = [v for effect, v in values if effect.name == named.effect.name]
    if not own:
        return named
    weights = special.softmax([v for _, v in values])
    names = {effect.name for effect, _ in values}
    share = named.probability + sum(p for rival, p in named.rivals if rival.name in names)
    found = [(effect, share * float(w)) for (effect, _), w in zip(values, weights, strict=True)]
    others = [pair for pair in named.rivals if pair[0].name not in names]
    others += [pair for pair in found if pair[0].name != named.effect.name and pair[1] > RIVAL_PROBABILITY]
    probability = min(1.0, sum(p for effect, p in found if effect.name == named.effect.name))
    return dataclasses.replace(named, probability=probability, rivals=sorted(others, key=lambda pair: -pair[1]))


def table(selector: Selector, scan: Scan) -> list[Candidate]:
    """The first scan as lines for the report: the best form of every label, the strongest first."""
    lines: dict[str, Candidate] = {}
    for i in np.argsort(-scan.statistic):
        effect, columns, statistic = scan.effects[i], len(selector.owners[i]), float(scan.statistic[i])
        symbols = effect.symbols()
        predicted = {symbols[field]: value for field, value in numbers(effect).items()}
        p_value = selector.p_value(int(i), scan)
        kept = float(selector.kept[i]) if selector.usable[i] else 0.0
        said = _outcome(bool(selector.usable[i]), bool(scan.right[i]), p_value)
        line = Candidate(effect.name, effect.label, statistic, columns, p_value, predicted, kept, said)
        lines.setdefault(f"{effect.label} {sorted(symbols.values())}", line)
    return list(lines.values())


def _outcome(usable: bool, right: bool, p_value: float) -> str:
    if not usable:
        return "absorbed by the coefficients"
    if p_value >= SIGNIFICANCE:
        return "not significant"
    return "significant" if right else "of inadmissible sign"
