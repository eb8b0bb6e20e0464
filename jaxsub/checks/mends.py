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
    - `amount`: the factor, which is -1 of a sign; the mean difference (unit of the channel); the delay, or that of a
      clock at the end of the run (s), positive for late.
    """

    kind: Kind
    channels: tuple[str, ...]
    amount: float = 0.0


def undone(mends: Sequence[Mend], times: np.ndarray, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The samples (mends, samples) of channels without each of the faults `mends`, which differ in `amount` alone.

    They are NaN where that needs what is outside the run.
    """
    kind, channels = mends[0].kind, mends[0].channels
    amounts = np.array([[mend.amount] for mend in mends])
    old = [columns[name] for name in channels]
    if kind == "axis":
        old.reverse()
    if kind in ("sign", "factor"):
        old = [values / amounts for values in old]
    if kind == "drift":
        old = [values - amounts for values in old]
    if kind in ("delay", "clock"):
        share = (times - times[0]) / (times[-1] - times[0]) if kind == "clock" else np.ones(times.shape)
        rows, known = _nearest(times, times + amounts * share)
        old = [np.where(known, values[rows], np.nan) for values in old]
    whole = (len(mends), times.size)
    return {name: np.broadcast_to(values, whole) for name, values in zip(channels, old, strict=True)}


def gross(relation: Relation, names: Collection[str], factors: bool) -> list[Mend]:
    """Reversed signs, swapped axes and known `factors` of the channels `names` that could explain a contradiction."""
    found = []
    for name in sorted(relation.among):
        units = TURNS if is_angular(name) else TURNS | LENGTHS
        sizes = [size for known in units.values() for size in (known, 1.0 / known)] if factors else []
        found += [Mend("sign", (name,), -1.0), *(Mend("factor", (name,), size) for size in sizes)]
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


def _nearest(times: np.ndarray, when: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The row of the sample nearest to each time `when`, and whether that is neither in a hole nor outside of the run.

    To interpolate would average noise, and so make channels agree better at any delay between samples.
    """
    before = np.clip(np.searchsorted(times, when, side="right") - 1, 0, times.size - 2)
    nearest = before + (when - times[before] > times[before + 1] - when)
    steps, interval = np.diff(times), 0.5 * float(np.median(np.diff(times)))
    reach = np.where(steps > longest_step(times), interval, np.maximum(0.5 * steps, interval))
    return nearest, np.abs(when - times[nearest]) <= reach[before] * (1.0 + 1e-9)
