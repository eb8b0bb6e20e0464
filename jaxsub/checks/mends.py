"""Single faults that could explain why channels contradict each other, and the channels without them."""

import dataclasses
import math
from collections.abc import Collection, Mapping, Sequence
from typing import Literal

import numpy as np

from .increments import longest_step
from .relations import Relation

Kind = Literal["sign", "factor", "axis", "delay", "clock", "drift"]
ANGLES = ("phi", "theta", "psi")
_TRIADS = (("x", "y", "z"), ("u", "v", "w"), ("p", "q", "r"), ("ax", "ay", "az"))
# channels that one instrument has, so that its clock moves all of them
_INSTRUMENTS = (
    ("x", "y"), ("x", "y", "z"), ("u", "v"), ("u", "v", "w"), ("p", "q", "r"), ANGLES, (*ANGLES, "p", "q", "r"),
    ("ax", "ay", "az"), ("p", "q", "r", "ax", "ay", "az"),
)  # fmt: skip
TURNS = {"degrees": 180.0 / math.pi, "revolutions a minute": 30.0 / math.pi, "minutes": 60.0}
LENGTHS = {
    "thousandths, such as mm": 1000.0, "hundredths, such as cm": 100.0, "hours": 3600.0, "km/h": 3.6,
    "feet": 1.0 / 0.3048, "knots": 1.0 / 0.5144444,
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Mend:
    """One fault of one channel, or of the channels of one instrument, and how to undo it.

    **Fields**

    - `kind`: a reversed sign, a wrong factor, two axes swapped, a delay, a clock that runs at another rate, a mean
      difference.
    - `channels`: those that have it.
    - `amount`: the factor; the mean difference (unit of the channel); the delay, or that of a clock at the end of the
      run (s), positive for late.
    """

    kind: Kind
    channels: tuple[str, ...]
    amount: float = 0.0

    def undone(self, times: np.ndarray, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The samples (samples,) of these channels without the fault, NaN where that needs what is outside the run."""
        old = [columns[name] for name in self.channels]
        if self.kind == "axis":
            old.reverse()
        if self.kind in ("sign", "factor"):
            old = [values / self.amount if self.kind == "factor" else -values for values in old]
        if self.kind == "drift":
            old = [values - self.amount for values in old]
        if self.kind in ("delay", "clock"):
            late = np.full(times.shape, self.amount)
            if self.kind == "clock":
                late *= (times - times[0]) / (times[-1] - times[0])
            old = [_at(times, values, times + late) for values in old]
        return dict(zip(self.channels, old, strict=True))


def gross(relation: Relation, names: Collection[str], factors: bool) -> list[Mend]:
    """Reversed signs, swapped axes and known `factors` of the channels `names` that could explain a contradiction."""
    found = []
    for name in sorted(relation.among):
        units = TURNS if is_angular(name) else TURNS | LENGTHS
        sizes = [size for known in units.values() for size in (known, 1.0 / known)] if factors else []
        found += [Mend("sign", (name,)), *(Mend("factor", (name,), size) for size in sizes)]
        for triad in (*_TRIADS, ANGLES):
            pairs = [tuple(sorted((name, other))) for other in triad if name in triad and other != name]
            found += [Mend("axis", pair) for pair in pairs if pair[0] in names and pair[1] in names]
    return found


def late(kind: Kind, names: Collection[str], lags: Sequence[float]) -> list[list[Mend]]:
    """The delays `lags` (s) of each of the channels `names` and of each instrument that has several of them."""
    groups = {tuple(name for name in instrument if name in names) for instrument in _INSTRUMENTS}
    groups = {group for group in groups if len(group) > 1} | {(name,) for name in names}
    return [[Mend(kind, group, lag) for lag in lags] for group in sorted(groups)]


def is_angular(name: str) -> bool:
    """Whether a channel of a body is an angle or the rate of one."""
    return name in (*ANGLES, "p", "q", "r")


def known_factor(angular: bool, factor: float, near: float) -> str:
    """What a factor, or one over it, stands for between units; empty where it is none that is known."""
    shown = max(abs(factor), 1.0 / max(abs(factor), 1e-300))
    units = TURNS if angular else TURNS | LENGTHS
    return next((name for name, size in units.items() if abs(shown / size - 1.0) < near), "")


def _at(times: np.ndarray, values: np.ndarray, when: np.ndarray) -> np.ndarray:
    """The sample of `values` nearest to each other time, NaN in holes and outside of the run.

    To interpolate would average noise, and so make channels agree better at any delay between samples.
    """
    before = np.clip(np.searchsorted(times, when, side="right") - 1, 0, times.size - 2)
    nearest = before + (when - times[before] > times[before + 1] - when)
    steps, interval = np.diff(times), 0.5 * float(np.median(np.diff(times)))
    reach = np.where(steps > longest_step(times), interval, np.maximum(0.5 * steps, interval))
    return np.where(np.abs(when - times[nearest]) <= reach[before] * (1.0 + 1e-9), values[nearest], np.nan)
