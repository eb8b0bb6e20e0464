"""Is a force left that the motion predicts, whatever its name? A smooth one of each variable in each equation."""

import dataclasses
import itertools
from collections.abc import Sequence

import numpy as np
from scipy import special

from ..effects import KNOTS, SmoothForce, variables, with_numbers
from ..likelihood import Columns, Disturbance
from .columns import force_columns
from .evidence import Evidence
from .selector import SIGNIFICANCE
from .view import View

# places of the body, with which no force that is worth a description grows
_LEFT_OUT = ("x", "y")
_STILL = 1e-9


@dataclasses.dataclass(frozen=True)
class Pattern:
    """The force that best follows one variable, on top of what was chosen.

    **Fields**

    - `force`: with its predicted numbers. `p_value`: that so much is luck, corrected for all tried; `predicts`: whether
      it helps to predict parts of the recordings from the others.
    - `alone`: log evidence with it and nothing else.
    - `explained`: the share of what chosen effects and it explain together that the chosen ones explain alone.
    """

    force: SmoothForce
    p_value: float
    predicts: bool
    alone: float
    explained: float

    @property
    def significant(self) -> bool:
        """Whether it is there."""
        return self.predicts and self.p_value < SIGNIFICANCE

    @property
    def described(self) -> str:
        """The shortest sum of at most two plain terms that is near it: a description and no name."""
        x = np.linspace(self.force.low, self.force.high, KNOTS)
        y = np.array([float(getattr(self.force, f"a_{j}")) for j in range(KNOTS)])
        name = self.force.variable
        terms = {"1": np.ones(KNOTS), name: x, f"{name}²": x**2, f"{name} |{name}|": x * np.abs(x), f"{name}³": x**3}
        chosen = [*itertools.combinations(terms, 1), *itertools.combinations(terms, 2)]
        fits = [(pick, *_fitted(np.stack([terms[t] for t in pick], axis=1), y)) for pick in chosen]
        pick, weights, left = min(fits, key=lambda fit: KNOTS * np.log(fit[2] + 1e-12) + len(fit[0]) * np.log(KNOTS))
        said = " + ".join(f"{w:.3g} {t}" for w, t in zip(weights, pick, strict=True))
        return f"about {said}, which leaves {np.sqrt(left):.0%} of it"


def _fitted(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Weights of least squares, and the share of the squares that they leave."""
    weights = np.linalg.lstsq(columns, y)[0]
    return weights, float(np.sum((y - columns @ weights) ** 2) / max(np.sum(y**2), 1e-300))


def smooth_forces(view: View) -> list[SmoothForce]:
    """Every equation with every variable that moves."""
    starts, ends = variables(view.path.start), variables(view.path.end)
    live = view.path.steps > 0.0
    found = []
    for name in starts:
        x = np.broadcast_to(np.asarray(starts[name]), live.shape)[live]
        if name in _LEFT_OUT or name not in ends or not np.std(x) > _STILL:
            continue
        low, high = (float(f"{edge:.6g}") for edge in np.percentile(x, [1.0, 99.0]))
        if high > low:
            found += [SmoothForce(e, name, low, high) for e in view.vehicle.layout.equations]
    return found


def pattern(view: View, chosen: Evidence, columns: list[int], disturbances: list[Disturbance]) -> Pattern | None:
    """The force that recordings ask for most beyond the `columns` of what was `chosen`; None where nothing moves."""
    forces = smooth_forces(view)
    if not forces:
        return None
    hats = _all_hats(view, forces)
    own = chosen.picked(columns)
    evidence = Evidence.of(view, own + hats, disturbances)
    held = list(range(len(columns)))
    owners = _owners(forces, len(columns))
    products = evidence.best(held)[1]
    gains = products.gains(held, owners)
    best = int(np.argmax(gains.statistic))
    p_value = min(1.0, len(forces) * float(special.chdtrc(KNOTS, float(gains.statistic[best]))))
    names = [f"a_{j}" for j in range(KNOTS)]
    size = gains.amplitudes[best] / evidence.length[owners[best]]
    force = with_numbers(forces[best], dict(zip(names, size.tolist(), strict=True)))
    alone = max(p.log_evidence([]) + float(np.max(p.gains([], owners).evidence)) for p in evidence.products)
    both = [*held, *owners[best]]
    predicts = evidence.best(both)[1].predicted(both) > products.predicted(held)
    return Pattern(force, p_value, predicts, alone, _explained(evidence, held, owners[best]))


def most_explained(view: View, disturbance: Disturbance) -> float:
    """The largest share of the errors under a `disturbance` that one smooth force alone explains."""
    forces = smooth_forces(view)
    if not forces:
        return 0.0
    products = Evidence.of(view, _all_hats(view, forces), [disturbance]).products[0]
    return float(np.max(products.explained([], _owners(forces, 0))))


def _owners(forces: Sequence[SmoothForce], first: int) -> list[list[int]]:
    """The columns of each force's hats, which begin after the `first`."""
    return [list(range(first + KNOTS * i, first + KNOTS * (i + 1))) for i in range(len(forces))]


def _all_hats(view: View, forces: Sequence[SmoothForce]) -> Columns:
    return force_columns(view, [column for force in forces for column in _hats(view, force)])


def _explained(evidence: Evidence, held: list[int], more: list[int]) -> float:
    """How much of the fall of χ² with both comes with the chosen alone, under the disturbance that suits both."""
    products = evidence.best([*held, *more])[1]
    whole = products.fall([*held, *more])
    return float(np.clip(products.fall(held) / whole, 0.0, 1.0)) if whole > 0.0 else 1.0


def _hats(view: View, force: SmoothForce) -> list[np.ndarray]:
    """The force of each of its hats at both ends of each interval, (2, R, K-1, n)."""
    equations = view.vehicle.layout.equations
    own = np.eye(len(equations))[equations.index(force.equation)]
    shape = view.path.steps.shape
    ends = [np.broadcast_to(np.asarray(variables(m)[force.variable]), shape) for m in (view.path.start, view.path.end)]
    place = np.clip((np.stack(ends) - force.low) / (force.high - force.low), 0.0, 1.0) * (KNOTS - 1)
    return [np.maximum(0.0, 1.0 - np.abs(place - j))[..., None] * own for j in range(KNOTS)]
