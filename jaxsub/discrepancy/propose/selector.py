"""The gain of every candidate on top of those already selected."""

import collections
import copy
import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import special

from ...effects import AbstractEffect, RunVariation, admissible, admitted, amplitudes, numbers, with_numbers
from .. import settings
from ..linearise.columns import plausible
from ..linearise.evidence import Evidence, most_columns
from ..linearise.products import Products
from ..linearise.view import View
from .multiplicity import family_wise, independent_tests


@dataclasses.dataclass(frozen=True)
class Scan:
    """Every candidate on top of some chosen ones.

    **Fields**

    - `value`: (m,) as `Selector.value`, at the disturbance that suits each best; minus infinity where physics forbids
      it.
    - `statistic`: (m,) χ² over the chosen ones alone. `effects`: with predicted numbers. `right`: (m,) of admissible
      sign.
    """

    value: np.ndarray
    statistic: np.ndarray
    effects: Sequence[AbstractEffect]
    right: np.ndarray


class _WithAmplitudes(Sequence[AbstractEffect]):
    """Candidates with predicted amplitudes, each made when it is read: few ever are."""

    def __init__(self, candidates: Sequence[AbstractEffect], sizes: Sequence[np.ndarray]):
        self._candidates, self._sizes = candidates, sizes

    def __len__(self) -> int:
        return len(self._candidates)

    def __getitem__(self, index):
        return predict(self._candidates[index], self._sizes[index])[0]


class _Admitted:
    """Between which values physics admits the amplitudes of candidates, all their columns one after the other."""

    def __init__(self, candidates: Sequence[AbstractEffect]):
        bounds: list[tuple[float, float]] = []
        self._first, self._shapes = [], []
        for effect in candidates:
            self._first.append(len(bounds))
            own, names = admitted(effect), amplitudes(effect)
            # a lag that wants to be of the other sign shows as a negative share of its own grid value
            bounds += [own[name] for name in names] or [(np.nextafter(0.0, 1.0), np.inf), (-np.inf, np.inf)]
            # an amplitude of zero is always admitted, so that this asks about the shapes alone
            self._shapes.append(not names or admissible(effect, numbers(effect) | dict.fromkeys(names, 0.0)))
        self._low, self._high = np.array(bounds).reshape(-1, 2).T

    def __call__(self, sizes: Sequence[np.ndarray]) -> np.ndarray:
        """(m,) whether physics admits each candidate with its amplitudes `sizes`."""
        flat = np.concatenate([np.zeros(0), *sizes])
        within = (self._low <= flat) & (flat <= self._high)
        return np.logical_and.reduceat(within, self._first) & self._shapes if len(flat) else np.zeros(0, bool)


class Selector:
    """The evidence of sets of candidates, and the disturbances estimated for some of them."""

    def __init__(
        self,
        evidence: Evidence,
        candidates: Sequence[AbstractEffect],
        owners: Sequence[Sequence[int]],
        looked_at: Mapping[str, int],
    ):
        self.evidence, self.candidates, self.owners = evidence, list(candidates), [list(own) for own in owners]
        forms = collections.Counter(effect.name for effect in self.candidates)
        # every name is as probable as any other before the data, and within a name every form
        self.prior = -np.log([looked_at.get(effect.name, forms[effect.name]) for effect in self.candidates])
        # where candidates were chosen among more, each of those has its share
        labels = collections.Counter(effect.name for effect in {e.label: e for e in self.candidates}.values())
        among = [looked_at.get(effect.name, 0) / labels[effect.name] for effect in self.candidates]
        self.forms = np.maximum(among, 1.0)
        self._admitted = _Admitted(self.candidates)
        # a number that differs by run has a column for each, less the mean
        runs = len(evidence.view.followed.system.measured)
        self.varying = np.array([isinstance(effect, RunVariation) for effect in self.candidates], bool)
        self.degrees = np.where(self.varying, runs - 1, [len(own) for own in self.owners])
        self._begin()

    def _begin(self) -> None:
        """Nothing is estimated; what the coefficients absorb or the vehicle has is no candidate."""
        self.estimated: set[tuple[int, ...]] = set()
        self.by_simulation: set[int] = set()
        self._simulation: Products | None = None
        self.kept = self.evidence.products[0].kept(self.owners)
        present = {effect.label for effect in self.evidence.view.vehicle.all_effects}
        absent = np.array([effect.label not in present for effect in self.candidates], bool)
        self.usable = np.isfinite(self.kept) & (self.kept > settings.IDENTIFIABLE_SHARE) & absent
        columns = [self.owners[i] for i in np.flatnonzero(self.usable & ~self.varying)]
        squares, _ = self.evidence.products[0].remaining([], range(len(self.evidence.length)))
        # numbers that may differ by run have columns of their own, and count as one test each
        varying = int(np.sum(self.usable & self.varying))
        self.tests = independent_tests(squares, columns, 1.0 / self.evidence.products[0].samples) + varying

    def seen_from(self, view: View, keep: np.ndarray) -> "Selector":
        """The same candidates for a view that `Evidence.seen_from` takes."""
        other = copy.copy(self)
        other.evidence = self.evidence.seen_from(view, keep)
        other._begin()
        return other

    def columns(self, chosen: Sequence[int]) -> list[int]:
        """The columns of candidates."""
        return [column for i in chosen for column in self.owners[i]]

    def value(self, chosen: Sequence[int]) -> float:
        """Log evidence under the best disturbance plus log prior probability."""
        return self.evidence.best(self.columns(chosen))[0] + float(np.sum(self.prior[list(chosen)]))

    def estimate(self, chosen: Sequence[int]) -> None:
        """Estimate the disturbance with `chosen` in the model."""
        key = tuple(sorted(chosen))
        if key not in self.estimated:
            self.estimated.add(key)
            own = self.columns(chosen)
            self.evidence.products.append(self.evidence.estimate(own, self.evidence.best(own)[1].disturbance))

    def scan(self, chosen: Sequence[int], under: Products | None = None) -> Scan:
        """Every candidate on top of `chosen`, under the disturbance of some products or under the best."""
        own = self.columns(chosen)
        among = self.evidence.products if under is None else [under]
        base = max(products.log_evidence(own) for products in among)
        best, statistic = np.full(len(self.candidates), -np.inf), np.zeros(len(self.candidates))
        sizes: list[np.ndarray] = [np.zeros(len(columns)) for columns in self.owners]
        for products in among:
            gains, at = products.gains(own, self.owners), products.log_evidence(own)
            values = at + gains.evidence
            for i in np.flatnonzero(values > best):
                # twice the gain in likelihood, the disturbances of both their own
                best[i], sizes[i] = values[i], gains.amplitudes[i]
                statistic[i] = max(0.0, gains.statistic[i] + 2.0 * (at - base))
        sizes = [a / self.evidence.lengths[o] for a, o in zip(sizes, self.owners, strict=True)]
        effects, taken = _WithAmplitudes(self.candidates, sizes), {self.candidates[i].label for i in chosen}
        fresh = np.array([effect.label not in taken for effect in self.candidates], bool)
        right = self.usable & self._admitted(sizes) & fresh
        # worth a look only where evidence rises, so that it may be chosen
        for i in np.flatnonzero(right & (best + self.prior > base)):
            right[i] = plausible(self.evidence.view, effects[i])
        fine = right & (len(own) + np.array([len(columns) for columns in self.owners]) <= most_columns())
        value = best + self.prior + float(np.sum(self.prior[list(chosen)]))
        return Scan(np.where(fine, value, -np.inf), np.where(self.usable, statistic, 0.0), effects, right)

    def absorbed(self, chosen: Sequence[int]) -> list[int]:
        """The best candidates on top of `chosen` under smaller disturbances, which may have absorbed them."""
        scans = [self.scan(chosen, under) for under in self.evidence.given[1:]]
        leaders = {int(np.argmax(scan.value)): float(np.max(scan.value)) for scan in scans}
        return [index for index, value in leaders.items() if np.isfinite(value)]

    @property
    def simulation(self) -> Products:
        """The products of a simulation's error, made when they are first asked for."""
        self._simulation = self._simulation or self.evidence.simulated()
        return self._simulation

    def simulation_shares(self, chosen: Sequence[int]) -> np.ndarray:
        """(m,) the share of the simulation error left by `chosen` that each candidate explains."""
        return self.simulation.explained(self.columns(chosen), self.owners)

    def majority_shares(self) -> np.ndarray:
        """(m,) the share of a simulation error far above the noise that each candidate alone explains.

        0 where it is not most of them, or where the candidate is not significant.
        """
        noise = float(np.mean(np.asarray(self.evidence.view.disturbance.noise) ** 2))
        share = self.simulation_shares([])
        if not self.simulation.gram[0, 0] > settings.LARGE_ERROR**2 * noise * self.simulation.samples:
            return np.zeros_like(share)
        scan = self.scan([])
        p_values = np.array([self.p_value(i, scan) for i in range(len(self.candidates))])
        significant = (scan.value > self.value([])) & (p_values < settings.SIGNIFICANCE)
        return np.where((share > settings.MAJORITY) & significant, share, 0.0)

    def alternatives_to(self, chosen: Sequence[int], index: int) -> np.ndarray:
        """(m,) whether each candidate is an alternative to `index` on top of `chosen`.

        Where simulation selected it, those are none that leave much more of the simulation error or explain much less.
        """
        if index not in self.by_simulation:
            return np.ones(len(self.candidates), bool)
        share = self.simulation_shares(chosen)
        most = settings.MAJORITY
        return (most * (1.0 - share) <= 1.0 - share[index]) & (share >= most * share[index])

    def predicted(self, chosen: Sequence[int], index: int, under: Products) -> tuple[AbstractEffect, bool]:
        """A candidate with the parameters predicted beside `chosen`, and whether physics admits them."""
        own = self.owners[index]
        size = under.gains(self.columns(chosen), [own]).amplitudes[0]
        return predict(self.candidates[index], size / self.evidence.lengths[own])

    def predicts(self, chosen: Sequence[int], more: int) -> bool:
        """Whether `more` improves the prediction of parts of the recordings by the others."""
        before, after = self.columns(chosen), self.columns([*chosen, more])
        predicted = lambda columns: float(np.sum(self.evidence.predicted(columns, self.evidence.best(columns)[1])))
        return predicted(after) > predicted(before)

    def p_value(self, index: int, scan: Scan) -> float:
        """Of a candidate's χ², family-wise: the probability of so small a smallest p-value of all under the null."""
        own = self.forms[index] * special.chdtrc(self.degrees[index], scan.statistic[index])
        return family_wise(float(own), self.tests)

    def smallest_p_value(self, scan: Scan) -> float:
        """Of all candidates' χ², family-wise; uniform under the null."""
        return min((self.p_value(int(i), scan) for i in np.flatnonzero(self.usable)), default=1.0)


def predict(effect: AbstractEffect, amplitude: np.ndarray) -> tuple[AbstractEffect, bool]:
    """An effect with predicted amplitudes, and whether physics admits them."""
    names = amplitudes(effect)
    values = dict(zip(names, amplitude.tolist(), strict=True)) if names else {}
    return with_numbers(effect, values) if values else effect, bool(_Admitted([effect])([amplitude])[0])
