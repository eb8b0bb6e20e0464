"""Which cases there are: a condition each, and the effects spread evenly over every row."""

import dataclasses
import itertools
from collections.abc import Callable

import numpy as np

from .logs import LOGGED
from .truth import Truth
from .truths import OUTSIDE, TRUTHS, by_name, identifier

STRONG, WEAK, FAINT, SEVERAL = (3.0, 5.0, 10.0, 20.0), (1.0, 2.0), (0.5,), (3.0, 5.0, 10.0)
# effects that a nonlinear baseline holds already, or has in another form
_IN_NONLINEAR = ("coriolis-coupling", "quadratic-damping", "crossflow-drag", "turning-speed-loss", "current")
_SALT = 20_000


@dataclasses.dataclass(frozen=True)
class Way:
    """How a case is recorded.

    - `noise`: `white`; `coloured`, under disturbance forces too; `half` or `double`, its sigma misstated in the file;
      `estimated`, which leaves sigma to the judge.
    - `logs`: what is done to the samples, a name of `LOGGED`, or nothing.
    - `autopilot`: whether feedback of the measurements drives the body; `nonlinear`: whether its file is nonlinear.
    - `velocity`: whether velocities are logged; `seconds`: of a run.
    """

    noise: str = "white"
    logs: str = ""
    autopilot: bool = False
    nonlinear: bool = False
    velocity: bool = True
    seconds: float = 160.0


_LOGS = {name: Way(logs=name) for name in LOGGED}
_ESTIMATED, _CLOSED_LOOP, _NONLINEAR = Way("estimated"), Way(autopilot=True), Way(nonlinear=True)


@dataclasses.dataclass(frozen=True)
class Condition:
    """Cases of a kind: `planned` ones, `fresh` ones beyond them, on which no engine was corrected, and a `quick` few.

    Sizes and ways of recording are taken in turn. Each conceals so many `effects` at once, of the vocabulary unless
    `outside`.
    """

    planned: int
    fresh: int
    quick: int = 0
    sizes: tuple[float, ...] = STRONG
    ways: tuple[Way, ...] = (Way(),)
    effects: int = 1
    outside: bool = False


# new conditions stand at the end: a case's seed has the place of its condition in it
CONDITIONS: dict[str, Condition] = {
    "strong": Condition(88, 24, 2),
    "weak": Condition(88, 18, 1, WEAK),
    "faint": Condition(11, 0, 0, FAINT),
    "no_velocity": Condition(38, 10, 1, ways=(Way(velocity=False),)),
    "coloured": Condition(44, 12, 1, ways=(Way("coloured"),)),
    "sigma": Condition(44, 10, 1, ways=(Way("half"), Way("double"))),
    "pair": Condition(20, 8, 1, SEVERAL, effects=2),
    "triple": Condition(12, 6, 1, SEVERAL, effects=3),
    "outside": Condition(16, 8, 1, outside=True),
    "short": Condition(16, 0, 0, (5.0,), (Way(seconds=40.0), Way(seconds=80.0))),
    "none_white": Condition(10, 15, 1, effects=0),
    "none_coloured": Condition(10, 15, 1, ways=(Way("coloured"),), effects=0),
    "none_half": Condition(10, 15, 1, ways=(Way("half"),), effects=0),
    "none_double": Condition(10, 15, 1, ways=(Way("double"),), effects=0),
    "estimated": Condition(8, 8, ways=(_ESTIMATED,)),
    **{name: Condition(8, 4, ways=(way,)) for name, way in _LOGS.items()},
    "closed_loop": Condition(8, 8, ways=(_CLOSED_LOOP,)),
    "nonlinear": Condition(8, 8, ways=(_NONLINEAR,)),
    "ten": Condition(8, 6, 0, SEVERAL, effects=10),
    "none_logs": Condition(9, 27, ways=(_ESTIMATED, _CLOSED_LOOP, _NONLINEAR, *_LOGS.values()), effects=0),
}


@dataclasses.dataclass(frozen=True)
class Case:
    """One set of files: what they conceal (by key of `TRUTHS`), how much of it (sigmas), and how they are recorded."""

    condition: str
    number: int
    concealed: tuple[str, ...]
    size: float
    way: Way = Way()

    @property
    def name(self) -> str:
        """Its name in the results, and the folder of its files."""
        return f"{self.condition}-{self.number:03d}"

    @property
    def seed(self) -> int:
        """Of manoeuvres, coefficients and noise; no two cases share one."""
        return 1000 * list(CONDITIONS).index(self.condition) + self.number

    @property
    def fresh(self) -> bool:
        """Whether it lies beyond the plan, on whose cases engines were corrected."""
        return self.number >= CONDITIONS[self.condition].planned

    @property
    def sizes(self) -> list[float]:
        """Sizes to try, largest first: an effect that cannot be as large as asked may be smaller in its row."""
        row = next((r for r in (STRONG, WEAK, FAINT) if self.size in r), ())
        return [size for size in reversed(row) if size <= self.size]

    @property
    def body(self) -> str:
        """The vehicle."""
        if self.concealed:
            return TRUTHS[self.concealed[0]].vehicle
        return "nps" if self.way.autopilot or self.way.nonlinear else ("nps", "nps", "nps", "rig")[self.number % 4]


def cases(name: str, count: int) -> list[Case]:
    """The first `count` cases of the condition of that name; a longer list begins with a shorter one."""
    condition = CONDITIONS[name]
    rng = np.random.default_rng([_SALT, list(CONDITIONS).index(name)])
    ways, sizes, names = condition.ways, condition.sizes, len(by_name())
    if not condition.effects:
        return [Case(name, i, (), 0.0, ways[i % len(ways)]) for i in range(count)]
    if condition.outside:
        chosen = [(identifier(OUTSIDE[i % len(OUTSIDE)]),) for i in range(count)]
    elif condition.effects > 1:
        chosen = [_several(condition.effects, rng) for _ in range(count)]
    else:
        chosen = _one_each(count, rng, lambda truth: all(_possible(truth, way) for way in ways))
    # a step more in each round, so that every effect meets every size
    size = lambda i: sizes[(i + i // names) % len(sizes)]
    return [Case(name, i, keys, size(i), ways[i % len(ways)]) for i, keys in enumerate(chosen)]


def _one_each(count: int, rng: np.random.Generator, possible: Callable[[Truth], bool]) -> list[tuple[str, ...]]:
    """Every effect that is `possible` in turn, in an order of its own, with its forms in turn."""
    forms = {name: [truth for truth in truths if possible(truth)] for name, truths in by_name().items()}
    names = [name for name in forms if forms[name]]
    order = [names[i] for i in rng.permutation(len(names))]
    taken = {name: itertools.cycle(forms[name]) for name in names}
    return [(identifier(next(taken[order[i % len(order)]])),) for i in range(count)]


def _possible(truth: Truth, way: Way) -> bool:
    """Whether a case recorded in that way can conceal `truth`.

    Only the body with six degrees of freedom has other sensors than velocities, an autopilot, and a nonlinear file.
    """
    unseen = not way.velocity and {"sensor:u", "sensor:v", "sensor:w"} & set(truth.where)
    held = way.nonlinear and truth.name in _IN_NONLINEAR
    anywhere = way.velocity and not way.autopilot and not way.nonlinear
    return not unseen and not held and (anywhere or truth.vehicle.startswith("nps"))


def _several(count: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Effects on the same vehicle, of as many families as there are, and so not nearly collinear."""
    families: dict[str, list[str]] = {}
    for key, truth in TRUTHS.items():
        if truth.vehicle == "nps" and not truth.outside:
            families.setdefault(truth.family, []).append(key)
    picked: list[str] = []
    while len(picked) < count:
        for family in rng.permutation(sorted(families))[: count - len(picked)]:
            # two of one family are other effects in other places
            taken = [TRUTHS[key] for key in picked if TRUTHS[key].family == family]
            alike = lambda key, taken=taken: any(
                TRUTHS[key].name == t.name or TRUTHS[key].where == t.where for t in taken
            )
            picked.append(str(rng.choice([key for key in families[family] if not alike(key)])))
    return tuple(picked)


def ordered(counts: dict[str, int], fresh: bool = False) -> list[Case]:
    """All cases, so that whatever has been done when one stops covers every condition in proportion."""
    planned = {c: CONDITIONS[c].planned if fresh else 0 for c in counts}
    chosen = {c: cases(c, planned[c] + n)[planned[c] :] for c, n in counts.items()}
    listed = [((i + 0.5) / len(those), case) for those in chosen.values() for i, case in enumerate(those)]
    return [case for _, case in sorted(listed, key=lambda pair: (pair[0], pair[1].condition))]
