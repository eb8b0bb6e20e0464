"""The search for the single fault that explains best why channels contradict each other."""

import dataclasses
import math
from collections.abc import Collection, Iterator

import numpy as np

from .explanations import UNLIKE
from .increments import Comparison, Windows, compared, filled, integrated, white
from .mends import ANGLES, Kind, Mend, gross, is_angular, known_factor, late
from .relations import Motions, Relation

_SURE = 30.0  # log likelihood ratio of a fault, less what it costs
# what is free to take any value explains more by chance, and is less likely before the data than a unit that is known
_COST = {"sign": 0.0, "axis": 2.0, "factor": 4.0, "delay": 8.0, "drift": 8.0, "clock": 16.0}
_FREE = 8.0  # of a factor between no units that are known
_SCALE = 0.5e-6  # distance of sides that differ by a scale error of 0.1 %, below which nothing is explained
_AGREED = 0.3  # distance between a channel and its rate, beyond which a mend is none
_BAD = 0.004  # distance below which no factor is looked for
_ARMED = 0.1  # distance of sides with lever arms below which no factor is named
_APART = 0.35  # distance below which channels with terms that are not known do not contradict each other
# of the distance that is left: a fault is the main thing that is wrong
_LEFT = {"sign": 0.5, "axis": 0.5, "factor": 0.5, "delay": 0.7, "clock": 0.6, "drift": 0.7}
_KNOWN_ONLY = 0.05  # distance that a factor of a formula leaves, beyond which only a known factor is named
_FACTOR, _ROUGH = 1.15, 1.5  # factors that are none, where every term is known and where one is not
_ASKEW = 0.1  # rad: of the mounting of a gyro
_DRIFT = 0.3  # of the rate's rms
_ABOVE = 100.0  # times the variance of white noise
_INDEPENDENT = 2.5  # differences: a heading that wanders has few
_LAGS = np.array([2, 4, 8, 16, 32, 64, 128], float)  # rows
_FURTHEST = 0.1  # of the run
_LEAST = 1.5  # intervals between samples, below which a delay is none


class Search:
    """The relations of a run and what each fault, undone, would do to them."""

    def __init__(self, times: np.ndarray, motions: Motions, relations: list[Relation], reach: float):
        self._times, self._relations, self._reach = times, relations, reach
        self._raw = motions
        self._motions = motions.replaced(
            {name: filled(times, values, name in ANGLES) for name, values in motions.columns.items()}
        )
        self._windows = [self._windows_of(relation) for relation in relations]
        self._few = [windows.few for windows in self._windows]
        self._inside: dict[tuple[int, bool, Kind, float], Comparison | None] = {}
        pairs = [(self._windows, False), (self._few, True)]
        self._plain = {
            (i, few): self._compared(relation, None, windows[i])
            for windows, few in pairs
            for i, relation in enumerate(relations)
        }

    def mended(self, mend: Mend) -> "Search":
        """The search for what is wrong beside `mend`."""
        motions = self._raw.replaced(mend.undone(self._times, self._raw.columns))
        return Search(self._times, motions, self._relations, self._reach)

    def best(self, named: Collection[tuple[Kind, tuple[str, ...]]]) -> tuple[Mend, Relation] | None:
        """The fault that explains most, and the relation in which it shows most; None where none is significant.

        Kinds and channels that were `named` before are left out.
        """
        scored = [
            (gain[0], mend, gain[1])
            for mend in self._candidates()
            if (mend.kind, mend.channels) not in named and (gain := self._gain(mend))
        ]
        if not scored:
            return None
        score, mend, relation = max(scored, key=lambda entry: entry[0] - self._cost(entry[1]))
        return (mend, relation) if score - self._cost(mend) > _SURE else None

    def distance(self, relation: Relation, mend: Mend) -> float:
        """The least distance of a relation with `mend`."""
        found = self._compared(relation, mend, self._windows[self._relations.index(relation)])
        return math.inf if found is None else found.distance

    def contradicts(self, relation: Relation) -> Comparison | None:
        """The comparison of a relation whose sides have little in common though one is far above the noise of both."""
        plain = self._plain[self._relations.index(relation), False]
        if plain is None:
            return None
        values, rate = self._sides(relation, self._motions)
        interval = float(np.median(np.diff(self._times)))
        # white noise of both sides, integrated over as many samples as a window has
        noise = 2.0 * white(self._times, values) + plain.durations * interval * white(self._times, rate)
        signal = np.maximum(plain.changes, plain.integrals) ** 2
        clear = (signal > _ABOVE * noise) & (plain.independent > _INDEPENDENT)
        return plain if clear.any() and float(np.min(plain.distances[clear])) > UNLIKE else None

    def _candidates(self) -> Iterator[Mend]:
        names = set().union(*(relation.among for relation in self._relations))
        seen = set()
        for index, relation in enumerate(self._relations):
            plain = self._plain[index, False]
            if plain is None:
                continue
            bad = plain.distance > (_BAD if relation.exact else _APART)
            # a small velocity of reversed sign leaves a small distance
            coarse = gross(relation, names, factors=bad) if bad or relation.exact else []
            for mend in [*coarse, *_scales(relation, plain), *_drifts(relation, plain)]:
                if mend not in seen:
                    seen.add(mend)
                    yield mend
        exact = set().union(*(relation.among for relation in self._relations if relation.exact))
        for kind in ("delay", "clock"):
            yield from self._late(kind, exact)

    def _late(self, kind: Kind, names: set[str]) -> Iterator[Mend]:
        """The best delay of each channel and instrument that gains by one."""
        span, step = float(self._times[-1] - self._times[0]), float(np.median(np.diff(self._times)))
        lags = step * _LAGS
        lags = lags[lags <= _FURTHEST * span]
        if kind == "clock":
            lags = np.concatenate([lags[1::2], -lags[1::2]])
        found = []
        for group in late(kind, names, lags.tolist()):
            scores = [((self._gain(mend, loose=True) or (0.0,))[0], mend) for mend in group]
            if scores:
                found.append(max(scores, key=lambda entry: entry[0]))
        for score, mend in sorted(found, key=lambda entry: -entry[0])[:4]:
            if score > 0.3 * _SURE:
                yield self._zoomed(mend, score, step)

    def _zoomed(self, mend: Mend, score: float, step: float) -> Mend:
        """The delay of most gain about that of `mend`, to a fraction of a sample by a parabola."""
        gain = lambda amount: (self._gain(dataclasses.replace(mend, amount=amount), loose=True) or (0.0,))[0]
        best, stride = mend.amount, max(round(0.35 * abs(mend.amount) / step), 1)
        while stride:
            for amount in (best - stride * step, best + stride * step):
                other = gain(amount)
                if other > score:
                    score, best = other, amount
            stride //= 2
        before, after = gain(best - step), gain(best + step)
        curvature = before - 2.0 * score + after
        shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
        return dataclasses.replace(mend, amount=best + step * min(max(shift, -0.5), 0.5))

    def _gain(self, mend: Mend, loose: bool = False) -> tuple[float, Relation] | None:
        """The log likelihood ratio of a fault over all relations and where it is largest; None if it mends nothing."""
        total, top = 0.0, None
        for index, relation in enumerate(self._relations):
            if relation.among.isdisjoint(mend.channels):
                continue
            # a delay of all that takes part changes nothing
            if mend.kind in ("delay", "clock") and (not relation.exact or relation.among <= {*mend.channels}):
                continue
            plain = self._plain_beside(mend, index, loose)
            if plain is None:
                continue
            found = self._compared(relation, mend, (self._few if loose else self._windows)[index])
            if found is None:
                continue
            # residual noise is white after the right mend, and coloured by the fault before
            count = np.sqrt(plain.independent * found.independent)
            counts = plain.clear & found.clear & (plain.distances > _SCALE)
            ratios = np.where(counts, -count * np.log(_left(mend, plain, found)), np.nan)
            if not np.isfinite(ratios).any():
                continue
            at = int(np.nanargmax(np.abs(ratios)))
            total += float(ratios[at])
            # the mean of a rate shows in the channel whose rate it is, whatever else it explains
            names = mend.kind != "drift" or relation.partner == mend.channels[0]
            if names and (top is None or ratios[at] > top[0]):
                top = float(ratios[at]), relation, plain, found, at
        if top is None:
            return None
        _, relation, plain, found, at = top
        return (total, relation) if loose or self._mends(mend, relation, plain, found, at) else None

    def _plain_beside(self, mend: Mend, index: int, loose: bool) -> Comparison | None:
        """The comparison of a relation without `mend`, in the windows in which it can be made with it.

        A delay leaves the ends of a run unknown; a window there, a start from rest, would count for any delay.
        """
        if mend.kind not in ("delay", "clock"):
            return self._plain[index, loose]
        key = (index, loose, mend.kind, mend.amount)
        if key not in self._inside:
            nothing = dataclasses.replace(mend, channels=("",)).undone(self._times, {"": np.zeros(self._times.size)})
            windows = (self._few if loose else self._windows)[index]
            self._inside[key] = self._compared(self._relations[index], None, windows, nothing[""])
        return self._inside[key]

    def _mends(self, mend: Mend, relation: Relation, plain: Comparison, found: Comparison, at: int) -> bool:
        """Whether sides that were apart agree, and by more than what may be."""
        if found.distance > _AGREED or _left(mend, plain, found)[at] > _LEFT[mend.kind]:
            return False
        if mend.kind in ("delay", "clock"):
            interval = max(self._interval(name) for name in relation.among)
            return abs(mend.amount) > _LEAST * interval * (2.0 if mend.kind == "clock" else 1.0)
        if mend.kind == "drift":
            return True
        if not relation.exact and plain.distance < _APART:
            return False
        if mend.kind != "factor":
            return True
        if not relation.direct and found.distance > _KNOWN_ONLY and not self._is_known(mend):
            return False
        # a lever arm may look like a factor of a motion that hardly turns
        armed = relation.arms is not None
        if armed and plain.distance < _ARMED:
            return False
        size = max(abs(mend.amount), 1.0 / abs(mend.amount))
        return mend.amount < 0.0 or size > (_FACTOR if relation.exact and not armed else _ROUGH)

    def _cost(self, mend: Mend) -> float:
        return _COST[mend.kind] + (_FREE if mend.kind == "factor" and not self._is_known(mend) else 0.0)

    def _is_known(self, mend: Mend) -> bool:
        """Whether a factor is one between units."""
        return bool(known_factor(is_angular(mend.channels[0]), mend.amount, 1e-9))

    def _interval(self, name: str) -> float:
        return float(np.median(np.diff(self._times[np.isfinite(self._raw.columns[name])])))

    def _sides(self, relation: Relation, motions: Motions) -> tuple[np.ndarray, np.ndarray]:
        # a channel is looked at where it was sampled, not where it was filled in
        sampled = np.isfinite(self._raw.columns[relation.channel])
        return np.where(sampled, motions[relation.channel], np.nan), relation.rate(motions)

    def _windows_of(self, relation: Relation) -> Windows:
        return Windows.of(self._times, *self._sides(relation, self._motions))

    def _compared(
        self, relation: Relation, mend: Mend | None, windows: Windows, nothing: np.ndarray | float = 0.0
    ) -> Comparison | None:
        """A relation with `mend`, or without; `nothing` (samples,) is NaN where samples shall not count, else 0."""
        motions = (
            self._motions if mend is None else self._motions.replaced(mend.undone(self._times, self._motions.columns))
        )
        arms, limit = None, self._reach
        if relation.arms is not None:
            arms = relation.arms(motions)
        elif relation.leaks is not None:
            arms, limit = integrated(self._times, relation.leaks(motions)), _ASKEW
        values, rate = self._sides(relation, motions)
        return compared(self._times, values + nothing, rate + nothing, windows, arms, limit, relation.offset)


def _left(mend: Mend, plain: Comparison, found: Comparison) -> np.ndarray:
    """What a mend leaves of the squared differences at each length: by their own size, or by that of what it scales."""
    if mend.kind in ("factor", "axis"):
        return found.distances / plain.distances
    return found.residuals / plain.residuals


def _scales(relation: Relation, plain: Comparison) -> list[Mend]:
    """The factors, of either sign, by which both sides of a relation have one size over windows of some length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = plain.integrals / plain.changes
    ratios = ratios[plain.clear & np.isfinite(ratios) & (ratios > 0.0)]
    if plain.distance < _BAD:
        return []
    name = relation.partner if relation.direct else relation.channel
    return [
        Mend("factor", (name,), sign * float(ratio if relation.direct else 1.0 / ratio))
        for ratio in ratios
        for sign in (1.0, -1.0)
        if max(ratio, 1.0 / ratio) > _FACTOR
    ]


def _drifts(relation: Relation, plain: Comparison) -> list[Mend]:
    """The mean differences of a channel's rate from the channel that measures it, where they are large."""
    if not (relation.direct and relation.exact):
        return []
    rates = plain.integrals / plain.durations
    large = np.abs(plain.drifts) > np.maximum(
        _DRIFT * np.sqrt(np.maximum(rates**2 - plain.drifts**2, 0.0)), 6.0 * plain.drift_errors
    )
    large &= plain.clear
    return [Mend("drift", (relation.partner,), -float(drift)) for drift in plain.drifts[large]]
