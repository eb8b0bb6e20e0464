"""What the recordings say about each coefficient, why they say no more, and what would help."""

import dataclasses
from collections.abc import Iterable, Iterator
from typing import Literal

import numpy as np

from ..estimate import Assessment, Solution, assess
from ..likelihood.blocks import Watch, nobody
from .directions import FRACTION, Directions, subset
from .equivalence import Family, equivalent_systems
from .excitation import Excitation
from .tied import TiedNumber, tied_numbers

# what is said of a number that follows from coefficients that leave it open
FOLLOWS = "left open by its expression"
_SHOWN, _PARTNERS, _SHARE, _NAMED = 0.15, 5, 0.2, 3
Kind = Literal[
    "identified",
    "only in combination",
    "not excited",
    "at its lower bound",
    "at its upper bound",
    "not converged",
    "fit does not explain the runs",
    "left open by its expression",
]
# what is said once of all coefficients and not of each
_OF_ALL = {
    "not converged": "the search did not converge, so no coefficient counts as identified",
    "fit does not explain the runs": "the fit does not explain the runs, so no coefficient counts as identified",
}


@dataclasses.dataclass(frozen=True)
class CoefficientVerdict:
    """What the recordings say about one coefficient.

    **Fields**

    - `kind`: `identified`: its standard error is below half its size. `only in combination`: it would be if others were
      known. `not excited`: it would not be even then. `at its lower bound`, `at its upper bound`: it presses on it. A
      coefficient that would count as identified is `not converged` where the search did not end at an optimum, and
      `fit does not explain the runs` where residuals are too large, coloured or spiked.
    - `relative_error`: standard error in its own size, infinite where nothing bounds it.
    - `partners`: the coefficients that it may drift with, the strongest first.
    - `structural`: whether equivalent systems are the reason, so that no input helps.
    - `remedy`: what would identify it, empty where nothing is needed.
    """

    name: str
    kind: Kind
    relative_error: float
    partners: tuple[str, ...] = ()
    structural: bool = False
    remedy: str = ""

    def sentence(self) -> str:
        """The verdict in words."""
        if self.kind in _OF_ALL or self.kind.startswith("at its"):
            return f"{self.name}: {self.kind}; {self.remedy}."
        known = "unbounded" if not np.isfinite(self.relative_error) else f"known to {self.relative_error:.0%}"
        if self.kind == "identified":
            return f"{self.name}: identified, {known}."
        with_ = f" with {', '.join(self.partners)}" if self.partners else ""
        return f"{self.name}: {self.kind}{with_}, {known}; {self.remedy}."


@dataclasses.dataclass(frozen=True, repr=False)
class Identifiability:
    """Rank of the scaled Jacobian at the level of the noise, its null directions, and a verdict on each coefficient.

    **Fields**

    - `rank`, `parameters`: directions the recordings determine, and free parameters.
    - `null_directions`: for each direction left open, the relative change of each coefficient that matters in it.
    - `uncertainty`: of each direction, in the coefficients' own sizes, the worst first.
    - `verdicts`: one a coefficient. `families`: the equivalent systems behind them, none where no direction is open.
    - `tied`: one for each number that follows from coefficients, of which its `partners` are those. `tied_numbers`:
      these numbers.
    """

    rank: int
    parameters: int
    null_directions: list[dict[str, float]]
    uncertainty: list[float]
    verdicts: tuple[CoefficientVerdict, ...] = ()
    families: tuple[Family, ...] = ()
    tied: tuple[CoefficientVerdict, ...] = ()
    tied_numbers: tuple[TiedNumber, ...] = ()

    def __repr__(self) -> str:
        return "\n".join(self.sentences())

    def sentences(self) -> list[str]:
        """The verdict in words, a line each: rank, open directions, then the coefficients that are not identified."""
        lines = [f"The recordings determine {self.rank} of {self.parameters} directions of the free coefficients."]
        for direction, spread in zip(self.null_directions, self.uncertainty, strict=False):
            terms = " ".join(f"{share:+.2f}·Δ{name}/{name}" for name, share in direction.items())
            wide = f"Open to {spread:.0%} of their size" if np.isfinite(spread) else "Open without limit"
            lines.append(f"{wide}: {terms}")
        own = [v.sentence() for v in (*self.verdicts, *self.tied) if v.kind != "identified" and v.kind not in _OF_ALL]
        of_all = [
            f"{why[0].upper()}{why[1:]}." for kind, why in _OF_ALL.items() if kind in {v.kind for v in self.verdicts}
        ]
        return lines + own + of_all


def identifiability(fit: Solution, assessment: Assessment | None = None, watch: Watch = nobody) -> Identifiability:
    """The directions that a fit's recordings leave open, and a verdict on each coefficient.

    `assessment` says whether the fit explains its runs; it is made of the fit where none is given.
    `watch` is called with the share of the samples that is done.
    """
    if not fit.names:
        return Identifiability(0, 0, [], [])
    numbers = tied_numbers(fit)
    if not np.all(np.isfinite(np.asarray(fit.model.products))):
        unknown = tuple(
            CoefficientVerdict(n, "not converged", np.inf, remedy=_OF_ALL["not converged"]) for n in fit.names
        )
        return Identifiability(0, len(fit.names), [], [], unknown, tied_numbers=numbers)
    directions = Directions.of(fit, watch)
    open_ = np.flatnonzero(directions.open)
    null = []
    for vector in directions.vectors.T[open_]:
        vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
        null.append({n: round(float(d), 3) for n, d in zip(fit.names, vector, strict=True) if abs(d) > _SHOWN})
    families = tuple(equivalent_systems(fit.vehicle.at_mean)) if len(open_) else ()
    assessment = assess(fit) if assessment is None else assessment
    verdicts = tuple(_withheld(verdict, fit, assessment) for verdict in _verdicts(fit, directions, families))
    p = len(fit.names)
    tied = tuple(_withheld(verdict, fit, assessment) for verdict in _tied_verdicts(numbers, fit, directions))
    return Identifiability(p - len(open_), p, null, directions.uncertainty.tolist(), verdicts, families, tied, numbers)


def identifiable_subset(fit: Solution) -> tuple[str, ...]:
    """Free coefficients to hold at file values so that `fit` identifies the rest; added mass is held first."""
    if not fit.names:
        return ()
    still = np.asarray(fit.vehicle.mass_matrix())
    values = fit.vehicle.values()
    moves = lambda name: np.any(np.asarray(fit.vehicle.with_values({name: values[name] + 1.0}).mass_matrix()) != still)
    return subset(Directions.of(fit), tuple(name for name in fit.names if moves(name)))


def _verdicts(fit: Solution, directions: Directions, families: tuple[Family, ...]) -> tuple[CoefficientVerdict, ...]:
    pressed = tuple(i for i, name in enumerate(fit.names) if name in fit.at_bound)
    errors, alone = directions.relative_errors(pressed), directions.alone()
    if not (errors > FRACTION).any():
        return tuple(CoefficientVerdict(n, "identified", float(e)) for n, e in zip(fit.names, errors, strict=True))
    rows = np.array([[f.coefficients.get(n, 0.0) for n in fit.names] for f in families]).reshape(-1, len(fit.names))
    rows = rows / directions.size
    pinned = directions.relative_errors(pressed, rows)
    excitation = Excitation.of(fit)
    made = []
    for i, name in enumerate(fit.names):
        error = float(errors[i])
        if error <= FRACTION:
            made.append(CoefficientVerdict(name, "identified", error))
            continue
        mine = _mine(families, rows, i)
        if not alone[i] <= FRACTION:
            remedy = _more(name, alone[i], excitation) if np.isfinite(alone[i]) else _unseen(name, mine, excitation)
            made.append(CoefficientVerdict(name, "not excited", error, (), bool(mine), remedy))
            continue
        partners = _partners(directions, i)
        remedies = [_break(mine, partners)] if mine else []
        if pinned[i] > FRACTION:
            remedies.append(_separate(directions, i, partners, rows if mine else rows[:0], excitation))
        made.append(
            CoefficientVerdict(name, "only in combination", error, partners, bool(mine), "; besides, ".join(remedies))
        )
    return tuple(made)


def _tied_verdicts(
    numbers: Iterable[TiedNumber], fit: Solution, directions: Directions
) -> Iterator[CoefficientVerdict]:
    """Of each number that follows from coefficients, whether these are known well enough for it."""
    for tied in numbers:
        error = np.inf if {*tied.ends} & {*fit.at_bound} else directions.error_of(tied.slope * directions.size)
        relative = error / abs(tied.value) if tied.value else np.inf
        if relative <= FRACTION:
            yield CoefficientVerdict(tied.name, "identified", relative, tied.ends)
        else:
            remedy = f"it needs {' and '.join(tied.ends)} to smaller errors, or another expression"
            yield CoefficientVerdict(tied.name, FOLLOWS, relative, tied.ends, remedy=remedy)


def _withheld(verdict: CoefficientVerdict, fit: Solution, assessment: Assessment) -> CoefficientVerdict:
    """The verdict, unless the coefficient presses on a bound, or the fit is none that one could count on."""
    if verdict.name in fit.at_bound:
        kind: Kind = "at its lower bound" if fit.at_bound[verdict.name] == "lower" else "at its upper bound"
        remedy = "the optimum lies beyond it: widen the bound, or fix the coefficient and give the reason"
        return CoefficientVerdict(verdict.name, kind, np.inf, remedy=remedy)
    if verdict.kind != "identified":
        return verdict
    if not fit.converged:
        return dataclasses.replace(verdict, kind="not converged", remedy=_OF_ALL["not converged"])
    if not assessment.explains:
        kind = "fit does not explain the runs"
        return dataclasses.replace(verdict, kind=kind, remedy=assessment.reason() or _OF_ALL[kind])
    return verdict


def _mine(families: tuple[Family, ...], rows: np.ndarray, index: int) -> list[Family]:
    """The families in which the coefficient numbered `index` takes part, those that move it most first."""
    if not len(families):
        return []
    share = np.abs(rows[:, index]) / np.abs(rows).max(axis=1)
    return [families[i] for i in np.argsort(-share) if share[i] > 0.0]


def _partners(directions: Directions, index: int) -> tuple[str, ...]:
    """The coefficients that drift most when the one numbered `index` does."""
    moves = np.abs(directions.moves(index))
    moves[index] = 0.0
    order = [j for j in np.argsort(-moves)[:_PARTNERS] if moves[j] > _SHARE * moves.max()]
    return tuple(directions.names[j] for j in order)


def _break(families: list[Family], partners: tuple[str, ...]) -> str:
    """What breaks the families that a coefficient is in: no input does."""
    read = tuple(dict.fromkeys(state for family in families for state in family.reinterpreted))
    hold = f"hold {_one_of(partners)} at its known value or give it a prior"
    measure = f"measure {' and '.join(read)}, or " if read else ""
    leading = ", ".join(family.leading for family in families[:_NAMED])
    return f"no input distinguishes equivalent systems ({leading}): {measure}{hold}"


def _unseen(name: str, families: list[Family], excitation: Excitation) -> str:
    """What to do about a coefficient without any effect on what was recorded."""
    if any(family.leading == name for family in families):
        return (
            f"nothing that is measured feels it, whatever the input: measure {_signals(name, excitation)}, or hold it"
        )
    return f"these recordings do not feel it: {excitation.how(name)}"


def _signals(name: str, excitation: Excitation) -> str:
    """The states that a coefficient multiplies, or the motion that it makes where it multiplies none."""
    states = dict.fromkeys(signal.removesuffix("_dot") for signal in excitation.regressors[name])
    return " and ".join(s for s in states if s not in excitation.inputs) or "the motion that it makes"


def _more(name: str, alone: float, excitation: Excitation) -> str:
    """How much more excitation a coefficient needs, even with all others known."""
    rms = excitation.rms
    seen = [f"{s} (rms {rms[s]:.2g})" if s in rms else s for s in excitation.regressors[name]]
    larger = f"{' and '.join(seen) or 'the recording'} would have to be {alone / FRACTION:.1f} times as large"
    return f"even with the others known {larger}: {excitation.how(name)}"


def _separate(
    directions: Directions, index: int, partners: tuple[str, ...], pinned: np.ndarray, excitation: Excitation
) -> str:
    """What separates a coefficient from those whose regressors run alongside its own in these recordings."""
    name = directions.names[index]
    error = lambda held: directions.relative_errors((directions.names.index(held),), pinned)[index]
    left = {partner: error(partner) for partner in partners}
    best = min(left, key=lambda partner: left[partner], default="")
    signals = dict.fromkeys(s for n in (name, *partners[:1]) for s in excitation.regressors[n])
    # a constant is identifiable where the other varies
    moving = name if excitation.regressors[name] or not partners else partners[0]
    apart = (f"move {' and '.join(signals)} independently: " if len(signals) > 1 else "") + excitation.how(moving)
    if best and left[best] <= FRACTION:
        return f"{apart}; or hold {best}, which leaves {left[best]:.0%}"
    return apart + (f"; or hold {_one_of(partners, 'several')}" if best else "")


def _one_of(names: tuple[str, ...], some: str = "one") -> str:
    return f"{some} of {', '.join(names)}" if len(names) > 1 else "".join(names) or "it"
