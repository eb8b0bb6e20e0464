"""The search for the single fault that explains best why channels contradict each other."""

import collections
import dataclasses
import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from .explanations import UNLIKE
from .increments import Comparison, Windows, compared, filled, integrated, white
from .mends import ANGLES, Kind, Mend, gross, is_angular, known_factor, late, undone
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
        self._windows = [Windows.of(times, *self._sides(relation, self._motions)) for relation in relations]
        self._few = [windows.few for windows in self._windows]
        self._plain = [self._compared(index, self._motions) for index in range(len(relations))]
        self._inside: dict[tuple[Kind, tuple[float, ...], int, bool], Comparison | None] = {}

    def mended(self, mend: Mend) -> "Search":
        """The search for what is wrong beside `mend`."""
        without = undone([mend], self._times, self._raw.columns)
        motions = self._raw.replaced({name: values[0] for name, values in without.items()})
        return Search(self._times, motions, self._relations, self._reach)

    def best(self, named: Collection[tuple[Kind, tuple[str, ...]]]) -> tuple[Mend, Relation] | None:
        """The fault that explains most, and the relation in which it shows most; None where none is significant.

        Kinds and channels that were `named` before are left out.
        """
        alike = collections.defaultdict(list)
        for mend in self._candidates():
            if (mend.kind, mend.channels) not in named:
                alike[mend.kind, mend.channels].append(mend)
        scored = [
            (gain[0] - self._cost(mend), mend, gain[1])
            for mends in alike.values()
            for mend, gain in zip(mends, self._gains(mends), strict=True)
            if gain
        ]
        if not scored:
            return None
        # of faults that explain alike, whose scores differ by rounding alone, the first
        score, mend, relation = max(scored, key=lambda entry: round(entry[0], 6))
        return (mend, relation) if score > _SURE else None

    def distance(self, relation: Relation, mend: Mend) -> float:
        """The least distance of a relation with `mend`."""
        found = self._compared(self._relations.index(relation), self._without([mend]))
        return math.inf if found is None else found.distance.item()

    def contradicts(self, relation: Relation) -> Comparison | None:
        """The comparison of a relation whose sides have little in common though one is far above the noise of both."""
        plain = self._plain[self._relations.index(relation)]
        if plain is None:
            return None
        values, rate = self._sides(relation, self._motions)
        interval = float(np.median(np.diff(self._times)))
        holes = self._windows[self._relations.index(relation)].holes
        # white noise of both sides, integrated over as many samples as a window has
        integral = plain.durations * interval * white(self._times, rate, holes[1])
        noise = 2.0 * white(self._times, values, holes[0]) + integral
        signal = np.maximum(plain.changes, plain.integrals) ** 2
        clear = (signal > _ABOVE * noise) & (plain.independent > _INDEPENDENT)
        return plain if clear.any() and float(np.min(plain.distances[clear])) > UNLIKE else None

    def _candidates(self) -> Iterator[Mend]:
        names = set().union(*(relation.among for relation in self._relations))
        seen = set()
        for index, relation in enumerate(self._relations):
            plain = self._plain[index]
            if plain is None:
                continue
            bad = bool(plain.distance > (_BAD if relation.exact else _APART))
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
        if not lags.size:
            return
        found = []
        for group in late(kind, names, lags.tolist()):
            scores = self._scores(group)
            at = int(np.argmax(scores))
            found.append((scores[at], group[at]))
        for score, mend in sorted(found, key=lambda entry: -entry[0])[:4]:
            if score > 0.3 * _SURE:
                yield self._zoomed(mend, score, step)

    def _zoomed(self, mend: Mend, score: float, step: float) -> Mend:
        """The delay of most gain about that of `mend`, to a fraction of a sample by a parabola."""
        scores = lambda *amounts: self._scores([dataclasses.replace(mend, amount=amount) for amount in amounts])
        best, stride = mend.amount, max(round(0.35 * abs(mend.amount) / step), 1)
        while stride:
            amounts = best - stride * step, best + stride * step
            for amount, other in zip(amounts, scores(*amounts), strict=True):
                if other > score:
                    score, best = other, amount
            stride //= 2
        before, after = scores(best - step, best + step)
        curvature = before - 2.0 * score + after
        shift = 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0
        return dataclasses.replace(mend, amount=best + step * min(max(shift, -0.5), 0.5))

    def _scores(self, mends: Sequence[Mend]) -> list[float]:
        """The gain of each of several faults that differ in amount, by few windows and whatever it leaves."""
        return [gain[0] if gain else 0.0 for gain in self._gains(mends, loose=True)]

    def _gains(self, mends: Sequence[Mend], loose: bool = False) -> list[tuple[float, Relation] | None]:
        """The log likelihood ratio of each fault over all relations and where it is largest; None if it mends nothing.

        The faults `mends` differ in amount alone.
        """
        kind, channels, motions = mends[0].kind, mends[0].channels, self._without(mends)
        totals = [0.0] * len(mends)
        tops: list[tuple[float, Relation, Comparison, Comparison, int] | None] = [None] * len(mends)
        for index, relation in enumerate(self._relations):
            if relation.among.isdisjoint(channels):
                continue
            # a delay of all that takes part changes nothing
            if kind in ("delay", "clock") and (not relation.exact or relation.among <= {*channels}):
                continue
            plain, found = self._plain_beside(mends, index, loose), self._compared(index, motions, loose)
            if plain is None or found is None:
                continue
            plain, found = plain.repeated(len(mends)), found.repeated(len(mends))
            # residual noise is white after the right mend, and coloured by the fault before
            count = np.sqrt(plain.independent * found.independent)
            counts = plain.clear & found.clear & (plain.distances > _SCALE)
            ratios = np.where(counts, -count * np.log(_left(kind, plain, found)), np.nan)
            largest = np.argmax(np.where(np.isfinite(ratios), np.abs(ratios), -1.0), axis=-1)
            # the mean of a rate shows in the channel whose rate it is, whatever else it explains
            names = kind != "drift" or relation.partner == channels[0]
            for row, at in enumerate(largest.tolist()):
                ratio = float(ratios[row, at])
                if math.isnan(ratio):
                    continue
                totals[row] += ratio
                top = tops[row]
                if names and (top is None or ratio > top[0]):
                    tops[row] = ratio, relation, plain[row], found[row], at
        return [
            (total, top[1]) if top and (loose or self._mends(mend, *top[1:])) else None
            for mend, total, top in zip(mends, totals, tops, strict=True)
        ]

    def _plain_beside(self, mends: Sequence[Mend], index: int, loose: bool) -> Comparison | None:
        """The comparisons of a relation without each of `mends`, in the windows in which they can be made with it.

        A delay leaves the ends of a run unknown; a window there, a start from rest, would count for any delay.
        """
        kind = mends[0].kind
        if kind not in ("delay", "clock"):
            return self._plain[index]
        key = (kind, tuple(mend.amount for mend in mends), index, loose)
        if key not in self._inside:
            of_none = [dataclasses.replace(mend, channels=("",)) for mend in mends]
            nothing = undone(of_none, self._times, {"": np.zeros(self._times.size)})[""]
            self._inside[key] = self._compared(index, self._motions, loose, nothing)
        return self._inside[key]

    def _mends(self, mend: Mend, relation: Relation, plain: Comparison, found: Comparison, at: int) -> bool:
        """Whether sides that were apart agree, and by more than what may be."""
        if found.distance > _AGREED or _left(mend.kind, plain, found)[at] > _LEFT[mend.kind]:
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

    def _without(self, mends: Sequence[Mend]) -> Motions:
        """The motions (mends, samples) without each of several faults that differ in amount."""
        return self._motions.replaced(undone(mends, self._times, self._motions.columns))

    def _compared(
        self, index: int, motions: Motions, loose: bool = False, nothing: np.ndarray | float = 0.0
    ) -> Comparison | None:
        """A relation of `motions`, in few windows if `loose`.

        `nothing` (..., samples) is NaN where samples shall not count, else 0.
        """
        relation, windows = self._relations[index], (self._few if loose else self._windows)[index]
        arms, limit = (), self._reach
        if relation.arms is not None:
            arms = relation.arms(motions)
        elif relation.leaks is not None:
            arms, limit = [integrated(self._times, leak) for leak in relation.leaks(motions)], _ASKEW
        values, rate = self._sides(relation, motions)
        return compared(self._times, values + nothing, rate + nothing, windows, arms, limit, relation.offset)


def _left(kind: Kind, plain: Comparison, found: Comparison) -> np.ndarray:
    """What a mend leaves of the squared differences at each length: by their own size, or by that of what it scales."""
    if kind in ("factor", "axis"):
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
