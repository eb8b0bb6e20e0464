"""Which cases there are: a condition each, and the effects spread evenly over every row."""

import dataclasses
import itertools

import numpy as np

from .truths import OUTSIDE, TRUTHS, by_name, identifier

STRONG, WEAK, FAINT = (3.0, 5.0, 10.0, 20.0), (1.0, 2.0), (0.5,)
# condition: cases by default, and in --quick
COUNTS: dict[str, tuple[int, int]] = {
    "strong": (88, 2), "weak": (88, 1), "faint": (11, 0), "no_velocity": (38, 1), "coloured": (44, 1),
    "sigma": (44, 1), "pair": (20, 1), "triple": (12, 1), "outside": (16, 1), "short": (16, 0), "none_white": (10, 1),
    "none_coloured": (10, 1), "none_half": (10, 1), "none_double": (10, 1), "estimated": (8, 0),
    "varying_noise": (8, 0), "outliers": (8, 0), "dropout": (8, 0), "slow": (8, 0), "uneven": (8, 0),
    "quantised": (8, 0),
}  # fmt: skip
# so many cases of a condition beyond those, on which no engine was ever corrected
FRESH: dict[str, int] = {
    "strong": 24, "weak": 18, "no_velocity": 10, "coloured": 12, "sigma": 10, "pair": 8, "triple": 6, "outside": 8,
    "none_white": 15, "none_coloured": 15, "none_half": 15, "none_double": 15, "estimated": 5, "varying_noise": 3,
    "outliers": 4, "dropout": 4, "slow": 4, "uneven": 4, "quantised": 3,
}  # fmt: skip
_SALT = 20_000


@dataclasses.dataclass(frozen=True)
class Case:
    """One set of files: what they conceal (by key of `TRUTHS`), how much of it (sigmas), and how they are recorded."""

    condition: str
    number: int
    concealed: tuple[str, ...]
    size: float
    noise: str = "white"
    velocity: bool = True
    seconds: float = 160.0

    @property
    def name(self) -> str:
        """Its name in the results, and the folder of its files."""
        return f"{self.condition}-{self.number:03d}"

    @property
    def seed(self) -> int:
        """Of manoeuvres, coefficients and noise; no two cases share one."""
        return 1000 * list(COUNTS).index(self.condition) + self.number

    @property
    def fresh(self) -> bool:
        """Whether it lies beyond the plan, on whose cases engines were corrected."""
        return self.number >= COUNTS[self.condition][0]

    @property
    def sizes(self) -> list[float]:
        """Sizes to try, largest first: an effect that cannot be as large as asked may be smaller in its row."""
        row = next((r for r in (STRONG, WEAK, FAINT) if self.size in r), ())
        return [size for size in reversed(row) if size <= self.size]

    @property
    def body(self) -> str:
        """The vehicle."""
        return TRUTHS[self.concealed[0]].vehicle if self.concealed else ("nps", "nps", "nps", "rig")[self.number % 4]


def cases(condition: str, count: int) -> list[Case]:
    """The first `count` cases of a condition; a longer list begins with a shorter one."""
    rng = np.random.default_rng([_SALT, list(COUNTS).index(condition)])
    if condition.startswith("none_"):
        noise = condition.removeprefix("none_")
        return [Case(condition, i, (), 0.0, noise) for i in range(count)]
    if condition == "outside":
        chosen = [(identifier(OUTSIDE[i % len(OUTSIDE)]),) for i in range(count)]
    elif condition in ("pair", "triple"):
        chosen = [_several(2 if condition == "pair" else 3, rng) for _ in range(count)]
    else:
        chosen = _one_each(count, rng, velocity=condition != "no_velocity")
    sizes = {"weak": WEAK, "faint": FAINT, "pair": (3.0, 5.0, 10.0), "triple": (3.0, 5.0, 10.0)}.get(condition, STRONG)
    sizes = (5.0,) if condition == "short" else sizes
    names = len(by_name())
    made = []
    for i, keys in enumerate(chosen):
        # a step more in each round, so that every effect meets every size
        size = sizes[(i + i // names) % len(sizes)]
        noise = {"coloured": "coloured", "sigma": ("half", "double")[i % 2]}.get(condition, "white")
        seconds = (40.0, 80.0)[i % 2] if condition == "short" else 160.0
        made.append(Case(condition, i, keys, size, noise, condition != "no_velocity", seconds))
    return made


def _one_each(count: int, rng: np.random.Generator, velocity: bool) -> list[tuple[str, ...]]:
    """Every effect in turn, in an order of its own, with its forms in turn."""
    forms = {name: [t for t in truths if velocity or _seen(t)] for name, truths in by_name().items()}
    names = [name for name in forms if forms[name]]
    order = [names[i] for i in rng.permutation(len(names))]
    taken = {name: itertools.cycle(forms[name]) for name in names}
    return [(identifier(next(taken[order[i % len(order)]])),) for i in range(count)]


def _seen(truth) -> bool:
    """Whether it shows where velocities are not logged: no sensor of them, on the body that has other sensors."""
    return truth.vehicle.startswith("nps") and not {"sensor:u", "sensor:v", "sensor:w"} & set(truth.where)


def _several(count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Effects on the same vehicle, of different families and so not nearly collinear."""
    families: dict[str, list[str]] = {}
    for key, truth in TRUTHS.items():
        if truth.vehicle == "nps" and not truth.outside:
            families.setdefault(truth.family, []).append(key)
    picked = rng.permutation(sorted(families))[:count]
    return tuple(str(rng.choice(families[family])) for family in picked)


def ordered(counts: dict[str, int], fresh: bool = False) -> list[Case]:
    """All cases, so that whatever has been done when one stops covers every condition in proportion."""
    planned = {c: COUNTS[c][0] if fresh else 0 for c in counts}
    chosen = {c: cases(c, planned[c] + n)[planned[c] :] for c, n in counts.items()}
    listed = [((i + 0.5) / len(those), case) for those in chosen.values() for i, case in enumerate(those)]
    return [case for _, case in sorted(listed, key=lambda pair: (pair[0], pair[1].condition))]
