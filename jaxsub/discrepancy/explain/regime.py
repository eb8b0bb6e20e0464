"""The regime of a mismatch: a variable, and the side of a threshold, that its intervals have in common."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float

from ...effects import Motion, by_name
from ..propose.spline_basis import STILL
from ..records.diagnosis import Regime

# of the test by chance, and its level
_SHIFTS, _LEVEL = 199, 0.05
# area under the curve from which a variable marks a regime
_AREA = 0.75
# share of the samples that must lie inside and outside a regime's intervals
_SHARE = 0.01
INCIDENCE = ("attack", "sideslip")  # angles of the flow, rad

Variables = Mapping[str, Float[np.ndarray, "r k"]]


def regime_variables(motion: Motion) -> dict[str, Float[np.ndarray, "r k"]]:
    """The variables of regimes: speed, incidence and the variables of a force, by size where both signs occur."""
    named = {name: np.asarray(value) for name, value in by_name(motion).items()}
    flow = [named[name] for name in ("u", "v", "w") if name in named]
    if len(flow) == 3:
        u, v, w = np.broadcast_arrays(*flow)
        named |= {"speed": np.sqrt(u**2 + v**2 + w**2), **dict(zip(INCIDENCE, np.arctan2([w, v], u), strict=True))}
    moving = {name: value for name, value in named.items() if np.ndim(value) == 2 and np.std(value) > STILL}
    signed = {name: np.min(value) < 0.0 < np.max(value) for name, value in moving.items()}
    return {f"abs({name})" if signed[name] else name: np.abs(v) if signed[name] else v for name, v in moving.items()}


def regime(variables: Variables, inside: Bool[np.ndarray, "r k"], live: Bool[np.ndarray, "r k"]) -> Regime | None:
    """The regime that parts the samples `inside` some intervals from the other `live` ones best; None by chance.

    By the area under the curve of Mann and Whitney (1947), against that of the same intervals moved round in their
    runs, which keeps how long they are, and the best of all variables, which corrects for how many were tried. The
    threshold is Youden's (1950).
    """
    share = inside[live].mean() if live.any() else 0.0
    if not variables or not _SHARE < share < 1.0 - _SHARE:
        return None
    names = [*variables]
    from scipy import stats

    ranks = np.stack([stats.rankdata(variables[name][live]) for name in names])
    areas = _areas(ranks, inside[live])
    best = int(np.argmax(np.abs(areas - 0.5)))
    reached = abs(areas[best] - 0.5)
    if reached < _AREA - 0.5:
        return None
    rng = np.random.default_rng(0)
    exceeded = [np.max(np.abs(_areas(ranks, _moved(inside, live, rng)[live]) - 0.5)) >= reached for _ in range(_SHIFTS)]
    if (1 + np.sum(exceeded)) / (1 + _SHIFTS) > _LEVEL:
        return None
    return _parted(names[best], variables[names[best]][live], inside[live], bool(areas[best] > 0.5))


def _areas(ranks: Float[np.ndarray, "v n"], inside: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " v"]:
    count = int(inside.sum())
    return (ranks[:, inside].mean(axis=1) - 0.5 * (count + 1)) / (len(inside) - count)


def _moved(
    inside: Bool[np.ndarray, "r k"], live: Bool[np.ndarray, "r k"], rng: np.random.Generator
) -> Bool[np.ndarray, "r k"]:
    """The same intervals elsewhere: each run's samples turned round by any number of them."""
    moved = np.zeros_like(inside)
    for row, own, there in zip(moved, inside, live, strict=True):
        row[there] = np.roll(own[there], int(rng.integers(max(int(there.sum()), 1))))
    return moved


def _parted(name: str, values: np.ndarray, inside: np.ndarray, above: bool) -> Regime:
    """The threshold of one variable that catches most of what is inside and least of what is not."""
    order = np.argsort(-values if above else values)
    within, without = np.cumsum(inside[order]), np.cumsum(~inside[order])
    at = int(np.argmax(within / within[-1] - without / without[-1]))
    caught = (values >= values[order[at]]) if above else (values <= values[order[at]])
    rest = inside[~caught]
    outside = float(rest.mean()) if rest.size else 0.0
    return Regime(name, above, float(values[order[at]]), float(inside[caught].mean()), outside)
