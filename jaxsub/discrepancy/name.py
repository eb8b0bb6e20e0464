r"""Which physics was left out: forward selection with backward elimination by evidence, and the rivals' probabilities.

Nothing is refitted for a selection: along the motion that took place the recordings are close to linear in the
coefficients, in the amplitudes and in small changes of lags and the like, so a set of effects is judged by its block of
one matrix of products. The probability of an effect is its evidence over that of all that may stand in its place, the
others chosen held; equal before the data for every name, and within a name for every form.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import special

from ..effects import AbstractEffect, admissible, amplitudes, numbers, with_numbers
from .columns import plausible
from .diagnosis import Candidate
from .evidence import SLOTS, Evidence, Products
from .progress import Progress

SIGNIFICANCE = 0.01
MOST_EFFECTS = 4
_ABSORBED = 1e-4
_POSSIBLE = 0.02
# χ² from which a candidate may come to be chosen
_LOOKED_AT = 10.0
# disturbances estimated for rivals of one step
_TRIES = 3


@dataclasses.dataclass(frozen=True)
class Named:
    """An effect chosen: with its predicted numbers, the probability of its name, and the rivals with theirs."""

    effect: AbstractEffect
    probability: float
    rivals: list[tuple[AbstractEffect, float]]


@dataclasses.dataclass(frozen=True)
class Scan:
    """Every candidate on top of some chosen ones.

    **Fields**

    - `value`: (m,) log evidence at the disturbance that suits each best; minus infinity where physics forbids it.
    - `statistic`: (m,) χ² over the chosen ones alone. `effects`: with predicted numbers. `right`: (m,) of admissible
      sign.
    """

    value: np.ndarray
    statistic: np.ndarray
    effects: list[AbstractEffect]
    right: np.ndarray


@dataclasses.dataclass(frozen=True)
class Naming:
    """What was chosen, in order, and how.

    **Fields**

    - `products`: at the disturbance that is left. `columns`: of what was chosen. `value`: its log evidence.
    - `first`: the scan before any choice; `candidates`: its lines for the report.
    - `first_p`: p-value of the first choice.
    """

    named: list[Named]
    products: Products
    columns: list[int]
    value: float
    first: Scan
    candidates: list[Candidate]
    first_p: float


class Selector:
    """The evidence of sets of candidates, and the disturbances estimated for some of them."""

    def __init__(self, evidence: Evidence, candidates: Sequence[AbstractEffect], owners: Sequence[Sequence[int]]):
        self.evidence, self.candidates, self.owners = evidence, list(candidates), [list(own) for own in owners]
        self.kept = evidence.products[0].kept(self.owners)
        self.usable = np.isfinite(self.kept) & (self.kept > _ABSORBED)
        self.estimated: set[tuple[int, ...]] = set()

    def columns(self, chosen: Sequence[int]) -> list[int]:
        """The columns of candidates."""
        return [column for i in chosen for column in self.owners[i]]

    def value(self, chosen: Sequence[int]) -> float:
        """Log evidence at the best disturbance."""
        return self.evidence.best(self.columns(chosen))[0]

    def estimate(self, chosen: Sequence[int]) -> None:
        """Find the disturbance that is left with `chosen` in the model."""
        key = tuple(sorted(chosen))
        if key not in self.estimated:
            self.estimated.add(key)
            own = self.columns(chosen)
            self.evidence.products.append(self.evidence.estimate(own, self.evidence.best(own)[1].disturbance))

    def scan(self, chosen: Sequence[int]) -> Scan:
        """Every candidate on top of `chosen`."""
        own = self.columns(chosen)
        base = self.value(chosen)
        best, statistic = np.full(len(self.candidates), -np.inf), np.zeros(len(self.candidates))
        sizes: list[np.ndarray] = [np.zeros(len(columns)) for columns in self.owners]
        for products in self.evidence.products:
            gains, at = products.gains(own, self.owners), products.log_evidence(own)
            values = at + gains.evidence
            for i in np.flatnonzero(values > best):
                # twice the gain in likelihood, the disturbances of both their own
                best[i], sizes[i] = values[i], gains.amplitudes[i]
                statistic[i] = max(0.0, gains.statistic[i] + 2.0 * (at - base))
        taken = {self.candidates[i].label for i in chosen}
        effects, right = [], []
        for i, effect in enumerate(self.candidates):
            predicted, good = predict(effect, sizes[i] / self.evidence.length[self.owners[i]])
            effects.append(predicted)
            good = good and bool(self.usable[i]) and effect.label not in taken
            # worth a look only where it may be chosen
            right.append(good and (statistic[i] < _LOOKED_AT or plausible(self.evidence.view.path, predicted)))
        fine = np.array(right) & (len(own) + np.array([len(columns) for columns in self.owners]) <= SLOTS)
        return Scan(np.where(fine, best, -np.inf), np.where(self.usable, statistic, 0.0), effects, np.array(right))

    def predicts(self, chosen: Sequence[int], more: int) -> bool:
        """Whether `more` helps to predict parts of the recordings from the others."""
        before, after = self.columns(chosen), self.columns([*chosen, more])
        with_it = self.evidence.best(after)[1].predicted(after)
        return with_it > self.evidence.best(before)[1].predicted(before)

    def p_value(self, statistic: float, columns: int) -> float:
        """Of χ² with so many columns, corrected for all candidates tried."""
        tried = len({(c.label, *c.symbols()) for c in self.candidates})
        return min(1.0, tried * float(special.chdtrc(columns, statistic)))


def predict(effect: AbstractEffect, amplitude: np.ndarray) -> tuple[AbstractEffect, bool]:
    """An effect with predicted numbers, and whether physics admits them."""
    names = amplitudes(effect)
    if names:
        values = dict(zip(names, amplitude.tolist(), strict=True))
        found = with_numbers(effect, values)
        return found, admissible(effect, {**numbers(effect), **values})
    # a lag that wants to be of the other sign shows as a negative share of its own grid value
    return effect, bool(amplitude[0] > 0.0)


def select(selector: Selector, progress: Progress) -> tuple[list[int], list[Scan], list[float]]:
    """Candidates chosen one after the other; the scans before each choice and at the end; the p-values of each best.

    One that does not help to predict a part of the recordings from the others is passed over: a model that is wrong in
    other ways finds in any flexible enough effect something to fit, but not the same thing everywhere.
    """
    chosen: list[int] = []
    scans, p_values = [], []
    while True:
        progress(f"weighing the vocabulary ({len(chosen)} effects so far)")
        scan = _settled(selector, chosen)
        scans.append(scan)
        best = int(np.argmax(scan.value))
        gain = scan.value[best] - selector.value(chosen)
        p_values.append(
            selector.p_value(float(scan.statistic[best]), len(selector.owners[best])) if np.isfinite(gain) else 1.0
        )
        if not gain > 0.0 or p_values[-1] >= SIGNIFICANCE or len(chosen) == MOST_EFFECTS:
            return chosen, scans, p_values
        if not selector.predicts(chosen, best):
            selector.usable[best] = False
            scans.pop()
            p_values.pop()
            continue
        chosen = _without_idle(selector, [*chosen, best])


def _settled(selector: Selector, chosen: list[int]) -> Scan:
    """The scan once the leaders' own disturbances are known: what a rival leaves to a disturbance must not count."""
    for _ in range(_TRIES):
        scan = selector.scan(chosen)
        best = int(np.argmax(scan.value))
        if not np.isfinite(scan.value[best]) or scan.value[best] - selector.value(chosen) < -5.0:
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
    chosen, scans, p_values = select(selector, progress)
    value, products = selector.evidence.best(selector.columns(chosen))
    named = [_named(selector, chosen, i) for i in chosen]
    lines = table(selector, scans[0])
    return Naming(named, products, selector.columns(chosen), value, scans[0], lines, p_values[0])


def _named(selector: Selector, chosen: list[int], index: int) -> Named:
    """The probability of what stands in one place of the chosen set, and of what might stand there."""
    others = [i for i in chosen if i != index]
    scan = selector.scan(others)
    forms: dict[str, int] = {}
    for effect in selector.candidates:
        forms[effect.name] = forms.get(effect.name, 0) + 1
    log = scan.value - np.log([forms[effect.name] for effect in selector.candidates])
    weights = np.exp(log - np.max(log))
    weights /= np.sum(weights)
    by_name: dict[str, float] = {}
    best: dict[str, int] = {}
    for i, (effect, weight) in enumerate(zip(selector.candidates, weights, strict=True)):
        by_name[effect.name] = by_name.get(effect.name, 0.0) + float(weight)
        if weight > weights[best.setdefault(effect.name, i)]:
            best[effect.name] = i
    own = selector.candidates[index].name
    rivals = [(scan.effects[best[n]], p) for n, p in by_name.items() if n != own and p > _POSSIBLE]
    effect = scan.effects[index]
    return Named(effect, by_name[own], sorted(rivals, key=lambda rival: -rival[1]))


def table(selector: Selector, scan: Scan) -> list[Candidate]:
    """The first scan as lines for the report: the best form of every label, the strongest first."""
    lines: dict[str, Candidate] = {}
    for i in np.argsort(-scan.statistic):
        effect, columns, statistic = scan.effects[i], len(selector.owners[i]), float(scan.statistic[i])
        symbols = effect.symbols()
        predicted = {symbols[field]: value for field, value in numbers(effect).items()}
        p_value = selector.p_value(statistic, columns)
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
